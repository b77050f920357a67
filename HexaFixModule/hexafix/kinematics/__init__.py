"""Inverse and forward kinematics of the 6-SPS mechanism (Eq. 29, 30, 33)."""
