"""The split of the recognition error between the rings against a general minimiser."""

import numpy as np
import pytest
from hexafix.correction import RecognisedRings
from hexafix.correction.compensation import fuse_rings
from hexafix.geometry import Pose
from scipy.optimize import least_squares

FAR = np.array([0.6, 0.6, 0.6, 0.008, 0.008, 0.008])
"""Recognition errors as large as the gates let pass, mm and rad."""


def covariance(rng, share):
    root = np.diag(share * FAR) @ (np.eye(6) + 0.4 * rng.normal(size=(6, 6)))
    return root @ root.T


def cost_vector(unknown, rings, struts, weights):
    """Whitened ξ_A, ξ_B, ξ_t by composed poses; the constraint holds by construction."""
    moved = rings.distal @ Pose.exp(unknown[:6]) @ struts @ Pose.exp(unknown[6:])
    xi_a = (rings.proximal.inverse() @ moved).log()
    xi = (xi_a, unknown[:6], unknown[6:])
    return np.concatenate([w @ x for w, x in zip(weights, xi, strict=True)])


@pytest.mark.parametrize("seed", range(6))
def test_the_split_is_the_most_likely_one_for_large_errors_too(seed):
    rng = np.random.default_rng(seed)
    struts = Pose.exp([5.0, -7.0, 180.0, *(0.1 * rng.normal(size=3))])
    distal = Pose.exp([40.0, -200.0, 800.0, *rng.normal(size=3)])
    proximal = distal @ struts @ Pose.exp(FAR * rng.normal(size=6))
    of_rings = [covariance(rng, 0.4), covariance(rng, 0.4)]
    of_struts = covariance(rng, 0.2)
    rings = RecognisedRings(proximal, distal, *of_rings)
    fused_a, fused_b = fuse_rings(rings, theoretical=struts, theoretical_covariance=of_struts)
    weights = [np.linalg.inv(np.linalg.cholesky(c)) for c in (*of_rings, of_struts)]
    fit = least_squares(
        cost_vector,
        np.zeros(12),
        args=(rings, struts, weights),
        x_scale=np.tile(FAR, 2),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    expected_b = distal @ Pose.exp(fit.x[:6])
    expected_a = expected_b @ struts @ Pose.exp(fit.x[6:])
    for one, other in ((fused_a, expected_a), (fused_b, expected_b)):
        distance, angle = one.difference(other)
        assert distance < 1e-5
        assert np.degrees(angle) < 1e-6
