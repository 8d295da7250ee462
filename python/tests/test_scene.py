import gc
import unittest

import numpy as np
import place

import tileflight as tf


def plane(z=0.0):
    return tf.Scene.from_mesh([[-50, -50, z], [50, -50, z], [50, 50, z], [-50, 50, z]], [[0, 1, 2], [0, 2, 3]])


class SceneTest(unittest.TestCase):
    def test_rays_hit_a_plane_where_they_must(self):
        directions = np.array([[0, 0, -2], [0.3, 0.4, -1], [0, 0, 1]], dtype=float)
        hits = plane(1.0).cast_rays([[1, 2, 11]], directions)
        np.testing.assert_allclose(hits["distance"], [10, 10 * np.sqrt(1.25), np.inf])
        np.testing.assert_array_equal(hits["mesh"], [0, 0, -1])
        np.testing.assert_allclose(hits["normal"][:2], [[0, 0, 1]] * 2)

    def test_distances_to_the_surface(self):
        distances = plane().distance_to_surface([[0, 0, 3], [53, 0, 4], [0, 0, 30]], within=10)
        np.testing.assert_allclose(distances, [3, 5, np.inf])

    def test_a_place_is_loaded_whole(self):
        scene = place.scene()
        self.assertTrue(scene.complete)
        self.assertIsNone(scene.origin)
        low, high = scene.bounds
        np.testing.assert_allclose([low[:2], high[:2]], [[-40, -40], [40, 40]], atol=0.01)
        self.assertEqual(sum(len(mesh["triangles"]) for mesh in scene.meshes), scene.triangles)

    def test_views_cannot_be_written_and_outlive_their_scene(self):
        scene = tf.load(str(place.tileset()))
        mesh = scene.meshes[0]
        vertices = mesh["vertices"]
        copy = vertices.copy()
        with self.assertRaises(ValueError):
            vertices[0, 0] = 1.0
        self.assertEqual(mesh["texture"].shape[2], 3)
        del scene, mesh
        gc.collect()
        np.testing.assert_array_equal(vertices, copy)

    def test_voxels_are_those_that_extract_writes(self):
        out = place.work_folder() / "truth"
        written = tf.extract(place.tileset(), **place.REGION, out=out, voxel=2.0, force=True)
        grid = place.scene().voxelize(2.0)
        read = tf.read_binvox(str(out / "voxels.binvox"))
        self.assertEqual(len(grid), written["voxels_occupied"])
        np.testing.assert_allclose(read.origin, grid.origin, atol=1e-5)  # binvox has text
        np.testing.assert_array_equal(read.cells, grid.cells)
        np.testing.assert_allclose(grid.centers, grid.origin + 2.0 * (grid.cells + 0.5))

    def test_samples_lie_on_the_surface(self):
        samples = place.scene().sample_surface(per_m2=1.0)
        area = 80 * 80
        self.assertGreater(len(samples["points"]), area)
        self.assertLess(place.scene().distance_to_surface(samples["points"]).max(), 1e-5)
        np.testing.assert_allclose(np.linalg.norm(samples["normals"], axis=1), 1, atol=1e-5)

    def test_results_do_not_depend_on_threads(self):
        tf.set_threads(1)
        try:
            single = place.scene().voxelize(1.0).cells.copy()
        finally:
            tf.set_threads(0)
        np.testing.assert_array_equal(place.scene().voxelize(1.0).cells, single)

    def test_bad_input_is_one_line(self):
        with self.assertRaises(tf.InputError) as caught:
            tf.load("/nowhere/tileset.json")
        self.assertIn("/nowhere/tileset.json", str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))
        with self.assertRaises(tf.InputError):
            tf.Scene.from_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 7]])
        with self.assertRaisesRegex(ValueError, "center: latitude, longitude"):
            tf.load(str(place.tileset()), center=[1], size=[1, 1, 1])


if __name__ == "__main__":
    unittest.main()
