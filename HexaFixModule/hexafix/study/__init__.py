"""The paper's Section 4 and its experiment re-enacted: how many markers, where, how exact a pose.

Every answer is given three times: by covariance (exact), by Monte Carlo of the linear model, and
by full simulation of the recognition; for the paper's group method and for least squares.
"""

from hexafix.study.angles import AnglesStudy, study_angles
from hexafix.study.error_model import ErrorModel
from hexafix.study.estimates import StudySettings
from hexafix.study.number import NumberStudy, study_number

__all__ = [
    "AnglesStudy",
    "ErrorModel",
    "NumberStudy",
    "StudySettings",
    "study_angles",
    "study_number",
]
