import numpy as np

from postproc.geometry import arc_points, around, circles, rotation_about


def test_circles_through_three_points_of_a_known_one():
    rng = np.random.default_rng(2)
    centre, radius = rng.normal(size=(50, 3)), rng.uniform(0.01, 2.0, 50)
    normal = rng.normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, [0.3, 0.5, 0.8])
    start = centre + radius[:, None] * across / np.linalg.norm(across, axis=1, keepdims=True)
    sweep = rng.uniform(0.3, 6.0, 50)

    def turned(share):
        R = rotation_about(normal, share * sweep)
        return centre + np.einsum("nij,nj->ni", R, start - centre)

    found = circles(start, turned(0.4), turned(1.0))
    assert found.valid.all()
    np.testing.assert_allclose(found.centre, centre, atol=1e-9)
    np.testing.assert_allclose(found.normal, normal, atol=1e-9)
    np.testing.assert_allclose(found.radius, radius, atol=1e-9)
    np.testing.assert_allclose(found.sweep, sweep, atol=1e-9)
    np.testing.assert_allclose(around(start, centre, normal, 0.7 * sweep), turned(0.7), atol=1e-12)
    share = np.full(50, 0.7)
    along = arc_points(start, turned(1.0), centre, normal, sweep, share)
    np.testing.assert_allclose(along, turned(0.7), atol=1e-12)


def test_points_on_a_line_are_no_circle():
    start = np.zeros((3, 3))
    middle = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    end = np.array([[2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    assert not circles(start, middle, end).valid.any()
