"""Small studies made once, and the paper's method written a second time as an oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hexafix.study import StudySettings, study_angles, study_number

SIGMA_IMAGE, SIGMA_PLACE = 0.3, 0.4 / 6


@pytest.fixture(scope="session")
def a_number_study():
    return study_number(StudySettings(samples=2000, full_samples=400, workers=1))


@pytest.fixture(scope="session")
def an_angles_study():
    return study_angles(StudySettings(samples=400, full_samples=20, workers=1))


@pytest.fixture(scope="session")
def drawn(a_number_study, an_angles_study):
    from hexafix.study.figures import figure_5, figure_6, figure_7

    return {
        "figure-5": figure_5(a_number_study),
        "figure-6": figure_6(an_angles_study),
        "figure-7": figure_7(an_angles_study),
    }


@pytest.fixture(scope="session")
def saved(drawn, tmp_path_factory):
    """The bytes of every figure, in every format together."""
    from hexafix.study.plotting import save

    folder = tmp_path_factory.mktemp("figures")
    formats = {"figure-5": ("svg", "pdf", "png"), "figure-6": ("png",), "figure-7": ("pdf", "svg")}
    for name, suffixes in formats.items():
        for suffix in suffixes:
            save(drawn[name], folder / f"{name}.{suffix}")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class Oracle:
    """Eq. (8)-(19) on plain arrays for three or more markers of one height, near the identity.

    Shares no code with HexaFix; angles about the axes instead of matrices of Eq. (2).
    """

    @staticmethod
    def recognise(balls, radius, sweep, height):
        """X = (x y z α β γ), shape (..., 6), from balls (..., N, 3) and N believed t, φ, h."""
        n = balls.shape[-2]
        found = []
        for j in range(n):
            k, m = (j + n // 3) % n, (j + 2 * n // 3) % n
            first, second = balls[..., j, :] - balls[..., k, :], balls[..., k, :] - balls[..., m, :]
            w = np.cross(first, second)
            w = w / np.linalg.norm(w, axis=-1, keepdims=True)
            w = w * np.sign(w[..., 2:])  # near the identity the axis points up
            m1 = first / np.linalg.norm(first, axis=-1, keepdims=True)
            turn = sweep[..., k] - sweep[..., j]
            lam = np.arctan2(
                radius[..., k] * np.sin(turn), radius[..., j] - radius[..., k] * np.cos(turn)
            )
            back = lam - sweep[..., j]  # from m1 to u about w
            c, s = np.cos(back)[..., None], np.sin(back)[..., None]
            u = c * m1 + s * np.cross(w, m1)
            v = np.cross(w, u)
            place = (
                u * (radius * np.cos(sweep))[..., j, None]
                + v * (radius * np.sin(sweep))[..., j, None]
                + w * height[..., j, None]
            )
            alpha = np.arctan2(v[..., 2], w[..., 2])
            beta = np.arcsin(-u[..., 2])
            gamma = np.arctan2(u[..., 1], u[..., 0])
            angles = np.stack([alpha, beta, gamma], -1)
            found.append(np.concatenate([balls[..., j, :] - place, angles], -1))
        return np.mean(found, axis=0)

    @classmethod
    def linear(cls, sweep_deg, radius=100.0, height=20.0):
        """E|ΔX| of the paper's linear model, mm and degrees, (G, N) sweep angles to (G, 6)."""
        phi = np.radians(np.atleast_2d(np.asarray(sweep_deg, float)))
        n, step = phi.shape[1], 1e-4
        # each of the 6N errors once forwards and once backwards
        moves = step * np.concatenate([np.eye(6 * n), -np.eye(6 * n)]).reshape(-1, n, 2, 3)
        image, place = moves[:, :, 0], moves[:, :, 1]
        t, p, h = (x[:, None] for x in (np.full_like(phi, radius), phi, np.full_like(phi, height)))
        places = np.stack([t * np.cos(p), t * np.sin(p), h], -1)
        cos, sin = np.cos(p), np.sin(p)
        believed_t = t + place[..., 0] * cos + place[..., 1] * sin  # Eq. (25)
        believed_p = p + (-place[..., 0] * sin + place[..., 1] * cos) / t
        ends = cls.recognise(places + image, believed_t, believed_p, h + place[..., 2])
        slopes = (ends[:, : 6 * n] - ends[:, 6 * n :]) / (2 * step)
        sigma = np.tile(np.repeat([SIGMA_IMAGE, SIGMA_PLACE], 3), n)
        expected = np.sqrt(2 / np.pi * np.sum((slopes * sigma[:, None]) ** 2, axis=1))
        return expected * [1, 1, 1, *[180 / np.pi] * 3]

    @classmethod
    def simulated(cls, sweep_deg, samples, seed):
        """E|ΔX| of the group method on displaced balls, six numbers in mm and degrees."""
        phi = np.radians(np.asarray(sweep_deg, float))
        n = len(phi)
        t, h = np.full(n, 100.0), np.full(n, 20.0)
        places = np.stack([t * np.cos(phi), t * np.sin(phi), h], -1)
        balls = cls.displaced(places, samples, seed)
        return np.abs(cls.recognise(balls, t, phi, h)).mean(axis=0) * [1, 1, 1, *[180 / np.pi] * 3]

    @staticmethod
    def displaced(places, samples, seed):
        rng = np.random.default_rng(seed)
        shape = (samples, *places.shape)
        return places + rng.normal(0, SIGMA_IMAGE, shape) + rng.normal(0, SIGMA_PLACE, shape)

    @classmethod
    def fitted(cls, sweep_deg, samples, seed):
        """E|ΔX| of the best rigid motion by quaternions, six numbers in mm and degrees."""
        phi = np.radians(np.asarray(sweep_deg, float))
        places = np.stack([100 * np.cos(phi), 100 * np.sin(phi), np.full(len(phi), 20.0)], -1)
        balls = cls.displaced(places, samples, seed)
        middle, centre = balls.mean(axis=1), places.mean(axis=0)
        s = np.einsum("ni,knj->kij", places - centre, balls - middle[:, None])
        trace = np.trace(s, axis1=1, axis2=2)
        delta = np.stack([s[:, a, b] - s[:, b, a] for a, b in ((1, 2), (2, 0), (0, 1))], -1)
        horn = np.empty((samples, 4, 4))
        horn[:, 0, 0] = trace
        horn[:, 0, 1:] = horn[:, 1:, 0] = delta
        horn[:, 1:, 1:] = s + np.swapaxes(s, 1, 2) - trace[:, None, None] * np.eye(3)
        q = np.linalg.eigh(horn)[1][:, :, -1]
        q = q * np.sign(q[:, :1])
        w, x, y, z = q.T
        angles = np.stack(
            [
                np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                np.arcsin(2 * (w * y - z * x)),
                np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
            ],
            -1,
        )
        axis = q[:, 1:]
        turned = centre + 2 * np.cross(axis, np.cross(axis, centre) + w[:, None] * centre)
        errors = np.concatenate([middle - turned, np.degrees(angles)], -1)
        return np.abs(errors).mean(axis=0)


@pytest.fixture(scope="session")
def oracle():
    return Oracle
