"""The Python module against the commands' own numbers, closed forms and its stubs."""
import ast
import hashlib
import json
import os
import pathlib
import resource
import subprocess
import tempfile
import threading
import time
import unittest
import warnings

import numpy

import emmetrope

commands = pathlib.Path(os.environ["EMMETROPE_BIN"])


def command(name, *arguments):
    """What a command answers with --json."""
    line = [commands / f"emmetrope-{name}", *arguments, "--json", "--quiet"]
    return json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)


def make_fixture_case(folder):
    """A finished case made from formulas."""
    subprocess.run([commands.parent / "tests/make-fixture-case", folder], check=True)
    return folder


def note_hashes(case, made_from):
    """Writes into each stage.json what run_stage would: SHA-256 of the stage's files, and of those it was made from."""
    def hashes(stage):
        return {str(file.relative_to(case)): hashlib.sha256(file.read_bytes()).hexdigest()
                for file in sorted((case / stage).rglob("*")) if file.is_file() and file.name != "stage.json"}
    for stage, before in made_from.items():
        note = case / stage / "stage.json"
        note.write_text(json.dumps({**json.loads(note.read_text()), "inputs": hashes(before) if before else {},
                                    "outputs": hashes(stage)}))


class Eyes(unittest.TestCase):
    def test_figures_are_the_commands(self):
        for name in ("navarro", "atchison:-4", "liou-brennan"):
            eye, said = emmetrope.Eye(name), command("eye", name)
            for key in ("power_D", "object_focal_mm", "image_focal_mm", "object_principal_mm", "image_principal_mm",
                        "object_nodal_mm", "image_nodal_mm"):
                self.assertEqual(getattr(eye.cardinal_points(), key), said[key])
            for key in ("M_D", "J0_D", "J45_D"):
                self.assertEqual(getattr(eye.refraction(), key), said["refraction"][key])
            pupil = said["entrance_pupil"]
            self.assertEqual(eye.entrance_pupil(), (pupil["position_mm"], pupil["diameter_mm"]))
            self.assertEqual(eye.axial_length_mm, said["axial_length_mm"])

    def test_go_through_files_and_dictionaries(self):
        eye = emmetrope.Eye("arizona", accommodation_D=2, pupil_mm=3)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "eye.json")
            eye.write(file)
            again = emmetrope.Eye(file)
            lens = os.path.join(folder, "eye.zmx")
            self.assertTrue(all("dispersion" in note for note in eye.write(lens)))
            self.assertAlmostEqual(emmetrope.Eye(lens).refraction().M_D, eye.refraction().M_D, places=9)
        self.assertEqual(again.to_dict(), eye.to_dict())
        self.assertEqual(emmetrope.Eye.from_dict(eye.to_dict()).refraction().M_D, eye.refraction().M_D)
        self.assertEqual(eye.with_pupil(2).entrance_pupil()[1] / 2, eye.entrance_pupil()[1] / 3)

    def test_may_be_described_by_numbers_of_numpy(self):
        described, of_numpy = emmetrope.Eye("atchison:-4").to_dict(), emmetrope.Eye("atchison:-4").to_dict()
        described["surfaces"][-1]["radius_mm"] = [-12, -13]
        of_numpy["surfaces"][-1]["radius_mm"] = numpy.array([-12, -13])
        described["surfaces"][0]["radius_mm"] = 7.75
        of_numpy["surfaces"][0]["radius_mm"] = numpy.float32(7.75)
        self.assertEqual(emmetrope.Eye.from_dict(of_numpy).to_dict(), emmetrope.Eye.from_dict(described).to_dict())
        with self.assertRaisesRegex(emmetrope.InputError, "^the dictionary is no JSON: a set$"):
            emmetrope.Eye.from_dict({"name": {"no", "JSON"}})

    def test_a_lens_corrects(self):
        eye = emmetrope.Eye("atchison:-4")
        corrected = eye.with_spectacle("-4/0x0@12")
        self.assertLess(abs(corrected.refraction().M_D), 0.05)
        self.assertEqual(emmetrope.PowerVector(-2.5, 0.5, 0).sphero_cylinder()[:2], (-2.0, -1.0))
        self.assertEqual(repr(emmetrope.PowerVector(-1e-9, 0.5, -0.0)), "PowerVector(M_D=0.0000, J0_D=0.5000, J45_D=0.0000)")
        with self.assertRaisesRegex(emmetrope.UsageError, "wears a spectacle already"):
            corrected.with_spectacle("-1/0x0@12")

    def test_beyond_the_known_wavelengths_are_warned_of(self):
        eye = emmetrope.Eye("navarro")
        ray = ([0, 0, 10], [0, 0, -1])
        for ask in (eye.refraction, eye.cardinal_points, lambda nm: emmetrope.wavefront(eye, wavelength_nm=nm),
                    lambda nm: eye.retina_seeing(5, 0, nm), lambda nm: emmetrope.ray_path(eye, *ray, nm),
                    lambda nm: emmetrope.trace_rays(eye, *([row] for row in ray), nm)):
            with self.assertWarnsRegex(UserWarning, "at 250 nm the indices are extrapolated.*380 to 1000"):
                ask(250)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                ask(555)

    def test_what_the_retina_sees_is_where_it_looks(self):
        eye = emmetrope.Eye("navarro")
        at = eye.retina_seeing(30, -20)
        sight = eye.line_of_sight(at[0], at[1])
        self.assertAlmostEqual(numpy.degrees(numpy.arctan2(sight[0], sight[2])), 30, places=8)
        self.assertAlmostEqual(numpy.degrees(numpy.arctan2(sight[1], sight[2])), -20, places=8)
        self.assertIsNone(eye.line_of_sight(13, 0))
        self.assertGreater(eye.retina_seeing(95, 0)[2], eye.retina_seeing(75, 0)[2])
        self.assertIsNone(eye.retina_seeing(120, 0))
        with self.assertRaisesRegex(emmetrope.UsageError, "horizontal_deg and vertical_deg: nan and 0"):
            eye.retina_seeing(numpy.nan, 0)


class Errors(unittest.TestCase):
    def test_are_exceptions_with_status_and_remedy(self):
        with self.assertRaises(emmetrope.UsageError) as caught:
            emmetrope.Eye("nobody")
        self.assertEqual(caught.exception.status, 2)
        self.assertIn("nobody", str(caught.exception))
        with self.assertRaises(emmetrope.InputError):
            emmetrope.wavefront(emmetrope.Eye("navarro"), retina_mm=(13, 0))
        with self.assertRaises(emmetrope.Error):
            emmetrope.Eye.from_dict({"name": "empty"})
        for bad in ({"name": float("nan")}, {"name": numpy.float32(1)}):
            with self.assertRaises(emmetrope.InputError):
                emmetrope.Eye.from_dict(bad)
        for bad in (0.555, float("nan"), 1e9):
            with self.assertRaises(emmetrope.UsageError):
                emmetrope.wavefront(emmetrope.Eye("navarro"), wavelength_nm=bad)
            with self.assertRaises(emmetrope.UsageError):
                emmetrope.Eye("navarro").refraction(bad)
        eye = emmetrope.Eye("navarro")
        for bad in (-3, 0.003, 15, float("nan")):  # metres, or no iris
            for make in (eye.with_pupil, lambda mm: emmetrope.Eye("navarro", pupil_mm=mm),
                         lambda mm: emmetrope.Eye.from_case("anywhere", pupil_mm=mm)):
                with self.assertRaisesRegex(emmetrope.UsageError, "pupil_mm is .* mm, outside 0.5 to 9") as caught:
                    make(bad)
                self.assertEqual(caught.exception.remedy, "give 0.5 to 9 mm")
        for bad, said in (({"lens_index": float("nan")}, "lens_index is nan"), ({"age_years": -3}, "age_years is -3"),
                          ({"retinal_depth_mm": 5}, "retinal_depth_mm is 5")):
            with self.assertRaisesRegex(emmetrope.UsageError, said):
                emmetrope.Eye.from_case("anywhere", **bad)
        wavefront = emmetrope.wavefront(eye)
        wavefront.at_vertex(wavefront.paraxial, 0)  # a contact lens
        for bad in (0.012, -12, 500, float("nan")):
            with self.assertRaisesRegex(emmetrope.UsageError, "vertex_distance_mm is .* mm, outside 5 to 30"):
                wavefront.at_vertex(wavefront.paraxial, bad)
        with self.assertRaises(emmetrope.DeviceError):
            emmetrope.Tracer("no such device")
        with self.assertRaises(emmetrope.UsageError):
            emmetrope.trace_rays(emmetrope.Eye("navarro"), numpy.zeros((4, 2)), numpy.zeros((4, 3)))
        for make in (lambda: emmetrope.Tracer(threads=-1),
                     lambda: emmetrope.trace_rays(eye, [[0, 0, 10]], [[0, 0, -1]], threads=-1)):
            with self.assertRaisesRegex(emmetrope.UsageError, "threads is -1"):
                make()
        along = numpy.tile([0.0, 0.0, -1.0], (3, 1))
        for row in ([0, 0, 0], [0, 0, numpy.nan], [0, numpy.inf, -1], [1e-200, 0, -1e-200]):
            bad = along.copy()
            bad[2] = row
            with self.assertRaisesRegex(emmetrope.UsageError, "direction: ray 2"):
                emmetrope.trace_rays(emmetrope.Eye("navarro"), numpy.zeros((3, 3)), bad)
            with self.assertRaisesRegex(emmetrope.UsageError, "direction"):
                emmetrope.ray_path(emmetrope.Eye("navarro"), [0, 0, 10], row)
        with self.assertRaisesRegex(emmetrope.UsageError, "origin_mm: ray 0"):
            emmetrope.trace_rays(emmetrope.Eye("navarro"), numpy.full((3, 3), numpy.nan), along)


class Rays(unittest.TestCase):
    def test_are_the_commands(self):
        eye = emmetrope.Eye("navarro", pupil_mm=9)
        origin = numpy.array([[0, 2, 20], [1, -1, 20], [0, 0, 20], [9, 0, 20]], float)
        direction = numpy.array([[0, 0, -1], [0.01, 0, -1], [0, 0.02, -1], [0, 0, -1]], float)
        rays = emmetrope.trace_rays(eye, origin, direction)
        for k in range(4):
            said = command("ray", "--eye", "navarro", "--pupil", "9", "--from=" + ",".join(map(str, origin[k])),
                           "--to=" + ",".join(map(str, origin[k] + direction[k])))
            self.assertEqual(emmetrope.ray_states[rays.state[k]], said["state"])
            if not said["hits"]:
                continue
            last = said["hits"][-1]
            numpy.testing.assert_allclose(rays.position_mm[k], last["position_mm"], atol=1e-12)
            numpy.testing.assert_allclose(rays.direction[k], last["direction"], atol=1e-12)
            self.assertAlmostEqual(rays.opl_mm[k], last["opl_mm"], places=10)
            path = emmetrope.ray_path(eye, origin[k], direction[k])
            self.assertEqual([hit["surface"] for hit in path], [hit["surface"] for hit in said["hits"]])

    def test_are_the_same_on_any_number_of_threads(self):
        eye = emmetrope.Eye("navarro")
        random = numpy.random.default_rng(1)
        origin = numpy.column_stack([random.uniform(-2, 2, (20000, 2)), numpy.full(20000, 10.0)])
        direction = numpy.tile([0.0, 0.0, -1.0], (20000, 1))
        one, two = (emmetrope.trace_rays(eye, origin, direction, threads=n) for n in (1, 2))
        numpy.testing.assert_array_equal(one.position_mm, two.position_mm)
        # Float32 and other orders are converted.
        turned = emmetrope.trace_rays(eye, numpy.asfortranarray(origin), direction.astype("float32"))
        numpy.testing.assert_array_equal(one.position_mm, turned.position_mm)

    def test_leave_the_interpreter_to_others(self):
        eye = emmetrope.Eye("liou-brennan")  # a gradient: slow rays
        origin = numpy.tile([0.5, 0.5, 10.0], (3000, 1))
        direction = numpy.tile([0.0, 0.0, -1.0], (3000, 1))
        counted = [0]
        done = threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1
                time.sleep(0.0005)

        counter = threading.Thread(target=count)
        counter.start()
        before = counted[0]
        emmetrope.trace_rays(eye, origin, direction, threads=1)
        during = counted[0] - before
        done.set()
        counter.join()
        self.assertGreater(during, 5)


class Wavefronts(unittest.TestCase):
    def test_are_those_of_trace(self):
        with tempfile.TemporaryDirectory() as folder:
            command("trace", "--eye", "navarro", "--pupil", "3", "--wavelength", "555", "--fovea=6,2", "--size", "8x8",
                    "--samples", "32", "-o", folder)
            said = json.loads(pathlib.Path(folder, "wavefront.json").read_text())
        wavefront = emmetrope.wavefront(emmetrope.Eye("navarro", pupil_mm=3), (6, 2), wavelength_nm=555)
        numpy.testing.assert_array_equal(wavefront.zernike_um, said["zernike_um"])
        numpy.testing.assert_array_equal(wavefront.pupil_rim_mm, said["pupil_rim_mm"])
        for key in ("pupil_mm", "rms_um", "higher_order_rms_um"):
            self.assertEqual(getattr(wavefront, key), said[key])
        quality = wavefront.image_quality()
        self.assertEqual((quality.strehl, quality.vsotf), (said["strehl"], said["vsotf"]))
        numpy.testing.assert_array_equal(quality.mtf_tangential, said["mtf"]["tangential"])

    def test_field_is_a_column_of_wavefronts(self):
        eye = emmetrope.Eye("navarro", pupil_mm=2)
        with tempfile.TemporaryDirectory() as folder:
            emmetrope.write_field(eye, os.path.join(folder, "field"), 20, 20)
            field = json.loads(pathlib.Path(folder, "field", "field.json").read_text())
        self.assertEqual(list(zip(field["horizontal_deg"], field["vertical_deg"])),
                         [(0, 20), (-20, 0), (0, 0), (20, 0), (0, -20)])
        for k, at in enumerate(field["retina_mm"]):
            found = emmetrope.wavefront(eye, at[:2]).minimum_rms_spot
            self.assertAlmostEqual(found.M_D, field["minimum_rms_spot"]["M_D"][k], places=9)
        with self.assertRaises(emmetrope.UsageError):
            emmetrope.write_field(eye, "nowhere", 100, 5)

    def test_a_lens_in_the_pupil_sharpens(self):
        wavefront = emmetrope.wavefront(emmetrope.Eye("atchison:-4", pupil_mm=2))
        better = wavefront.image_quality(wavefront.minimum_rms_wavefront)
        self.assertGreater(better.strehl, 10 * wavefront.image_quality().strehl)
        values, pitch_arcmin, wraps = wavefront.point_spread(wavefront.minimum_rms_wavefront)
        self.assertAlmostEqual(float(values.sum()), 1, places=3)
        self.assertFalse(wraps)
        self.assertGreater(pitch_arcmin, 0)
        self.assertAlmostEqual(wavefront.at_vertex(wavefront.paraxial).M_D, -4, delta=0.1)


class Pictures(unittest.TestCase):
    def test_are_those_of_trace(self):
        with tempfile.TemporaryDirectory() as folder:
            file, own = os.path.join(folder, "a.png"), os.path.join(folder, "b.png")
            command("trace", "--eye", "navarro", "--size", "48x32", "--field-mm", "1.5x1", "--samples", "32",
                    "-o", file)
            picture = emmetrope.Tracer().picture(emmetrope.Eye("navarro"), size=(48, 32), field_mm=(1.5, 1), samples=32)
            picture.write_png(own)
            self.assertEqual(pathlib.Path(own).read_bytes(), pathlib.Path(file).read_bytes())
        self.assertEqual(picture.linear.shape, (32, 48, 3))
        self.assertEqual(sum(picture.states.values()), picture.rays)


    def test_of_the_visual_field_are_those_of_trace(self):
        with tempfile.TemporaryDirectory() as folder:
            file, own = os.path.join(folder, "a.png"), os.path.join(folder, "b.png")
            command("trace", "--eye", "navarro", "--scene", "perimeter", "--size", "48x48", "--field-deg", "200x200",
                    "--samples", "32", "-o", file)
            picture = emmetrope.Tracer().picture(emmetrope.Eye("navarro"), "perimeter", size=(48, 48),
                                                 field_deg=(200, 200), samples=32)
            picture.write_png(own)
            self.assertEqual(pathlib.Path(own).read_bytes(), pathlib.Path(file).read_bytes())
        self.assertFalse(picture.seen[0, 0])
        self.assertTrue(picture.seen[24, 24])
        for name in ("visual-angle", "visual_angle"):
            again = emmetrope.Tracer().picture(emmetrope.Eye("navarro"), "perimeter", size=(48, 48), projection=name,
                                               field_deg=(200, 200), samples=32)
            numpy.testing.assert_array_equal(again.linear, picture.linear)
        for bad in ({"projection": "perspective"}, {"field_mm": (6, 6), "field_deg": (60, 60)},
                    {"wavelength_nm": numpy.nan}, {"centre_mm": (numpy.nan, 0)}):
            with self.assertRaises(emmetrope.UsageError):
                emmetrope.Tracer().picture(emmetrope.Eye("navarro"), **bad)

    def test_irradiance_is_that_of_trace(self):
        with tempfile.TemporaryDirectory() as folder:
            command("trace", "--eye", "navarro", "--size", "16x8", "--samples", "32", "--irradiance", "80",
                    "--bands", "500:600:50", "--media-age", "60", "-o", folder)
            light = emmetrope.Tracer().irradiance(emmetrope.Eye("navarro"), size=(16, 8), samples=32,
                                                  luminance_cd_m2=80, bands_nm=(500, 600, 50), media_age_years=60)
            said = json.loads(pathlib.Path(folder, "irradiance.json").read_text())
            pages = pathlib.Path(folder, "irradiance.tiff").read_bytes()
        self.assertEqual(light.wavelength_nm, said["wavelength_nm"])
        self.assertEqual(light.transmittance, said["transmittance"])
        self.assertEqual(light.white_trolands, said["white_trolands"])
        self.assertEqual(light.irradiance.shape, (3, 8, 16))
        numpy.testing.assert_allclose(light.photons[1], light.irradiance[1] * 550e-9 / (6.62607015e-34 * 299792458), rtol=1e-6)
        self.assertEqual(light.trolands.shape, (8, 16))
        for band in light.irradiance:  # uncompressed strips of little-endian floats
            self.assertIn(band[0].tobytes(), pages)


    def test_have_labels(self):
        tracer, eye = emmetrope.Tracer(), emmetrope.Eye("navarro")
        picture = tracer.picture(eye, size=(6, 4), field_mm=(0.6, 0.4), centre_mm=(1, 0), samples=32).to_xarray()
        self.assertEqual(picture.dims, ("y_mm", "x_mm", "channel"))
        numpy.testing.assert_allclose(picture.x_mm, [0.75, 0.85, 0.95, 1.05, 1.15, 1.25])
        numpy.testing.assert_allclose(picture.y_mm, [-0.15, -0.05, 0.05, 0.15])
        light = tracer.irradiance(eye, "perimeter", size=(4, 4), field_deg=(240, 240), samples=32,
                                  bands_nm=(500, 600, 50)).to_xarray()
        self.assertEqual(light.irradiance.dims, ("wavelength_nm", "down_deg", "right_deg"))
        self.assertEqual(light.irradiance.attrs["units"], "W / (m^2 nm)")
        numpy.testing.assert_allclose(light.right_deg, [-90, -30, 30, 90])
        self.assertTrue(numpy.isnan(light.irradiance.values[0, 0, 0]))  # 127 degrees from the middle
        self.assertGreater(float(light.irradiance.sel(wavelength_nm=550, right_deg=30, down_deg=30)), 0)


class Corrections(unittest.TestCase):
    def test_sharpness_has_its_derivative(self):
        sharpness = emmetrope.Sharpness(emmetrope.Tracer(), emmetrope.Eye("atchison:-2"), wavelength_nm=555)
        lens = numpy.array([-1.7, 0.1, 0.05])
        value, gradient = sharpness(lens)
        for k in range(3):
            step = 0.01 * numpy.eye(3)[k]
            slope = (sharpness(lens + step)[0] - sharpness(lens - step)[0]) / 0.02
            self.assertAlmostEqual(gradient[k], slope, delta=0.02 * numpy.abs(gradient).max())
        self.assertGreater(sharpness([-1.95, 0, 0])[0], value)
        self.assertEqual(sharpness.images, 8)
        with self.assertRaises(emmetrope.UsageError):
            sharpness([numpy.nan, 0, 0])
        with self.assertRaises(emmetrope.InputError):
            emmetrope.Sharpness(emmetrope.Tracer(), emmetrope.Eye("navarro"), retina_mm=(100, 0))
        # The chart is where the retina looks, 14 degrees off the axis: a lens of -3 D blurs it.
        aside = emmetrope.Sharpness(emmetrope.Tracer(), emmetrope.Eye("navarro"), retina_mm=(4, 0))
        self.assertLess(aside([-3, 0, 0])[0], aside([0, 0, 0])[0] / 2)

    def test_is_the_commands(self):
        with tempfile.TemporaryDirectory() as folder:
            said = command("correct", "--eye", "arizona", "-o", folder)
        found = emmetrope.correct(emmetrope.Tracer(), emmetrope.Eye("arizona"))
        for key in ("M_D", "J0_D", "J45_D", "sphere_D", "rounded", "plano_cylinder", "wavefront_check"):
            self.assertEqual(found[key], said[key], key)
        lens, _ = emmetrope.sharpest_lens(emmetrope.Tracer(), emmetrope.Eye("arizona"))
        self.assertEqual(lens.M_D, said["M_D"]["value"])


class Commands(unittest.TestCase):
    def test_answer_as_dictionaries_and_fail_as_exceptions(self):
        from emmetrope import commands as run
        with tempfile.TemporaryDirectory() as folder:
            truth = run.phantom(os.path.join(folder, "study"), random=3, snr=0, quiet=True,
                                stack="head-axial:pixel_mm=1.6,slice_mm=1.6,matrix=88x40,slices=24,contrast=t1")
            self.assertIn("axial_length_mm", truth["eyes"]["od"])
            series = run.inventory(os.path.join(folder, "study", "dicom"), quiet=True)["series"]
            self.assertTrue(series[0]["usable"])
            page = run.view(eye="arizona", output=os.path.join(folder, "arizona.html"), quiet=True)
            self.assertLess(os.path.getsize(page["html"]), 2_000_000)
            with self.assertRaisesRegex(emmetrope.UsageError, "nobody"):
                run.view(eye="nobody", output=os.path.join(folder, "nobody.html"), quiet=True)
            with self.assertRaises(emmetrope.UsageError) as caught:
                run.phantom(os.path.join(folder, "other"), protocol="none")
            self.assertEqual(caught.exception.status, 2)
            with self.assertRaises(emmetrope.InputError) as caught:
                run.mesh(folder, quiet=True)
            self.assertTrue(caught.exception.remedy)
            with self.assertRaises(emmetrope.InputError) as caught:
                emmetrope.Case(folder).biometry("od")
            self.assertIn("emmetrope mesh", caught.exception.remedy)
            self.assertEqual(emmetrope.Case(folder).eyes, [])
            for wrong, kind in ((lambda: emmetrope.Case(os.path.join(folder, "nowhere")), emmetrope.InputError),
                                (lambda: emmetrope.Case(folder).fit("OD"), emmetrope.UsageError),
                                (lambda: run.mesh(None), emmetrope.UsageError)):
                with self.assertRaises(kind):
                    wrong()
            traced = run.trace(eye="navarro", fovea=(2, 0), size="16x16", samples=32, output=os.path.join(folder, "out"),
                               quiet=numpy.bool_(True))
            self.assertEqual(traced["samples"], 32)


class Cases(unittest.TestCase):
    def test_what_the_commands_refuse_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            case = emmetrope.Case(make_fixture_case(os.path.join(folder, "case")))
            stages = {"segmentation": None, "meshing": "segmentation", "raytrace": "meshing", "correction": "raytrace"}
            note_hashes(case.folder, stages)
            case.eye("od"), case.fit("od"), case.biometry("od"), case.wavefront("od"), case.prescription("od")

            retina = case.folder / "meshing/od/retina.ply"
            with open(retina, "ab") as file:
                file.write(b" ")
            for read in (case.biometry, case.eye, lambda eye: emmetrope.Eye.from_case(str(case.folder), eye)):
                with self.assertRaisesRegex(emmetrope.InputError, "retina.ply has been changed since meshing") as caught:
                    read("od")
                self.assertEqual(caught.exception.status, 3)
                self.assertIn("emmetrope mesh", caught.exception.remedy)

            note_hashes(case.folder, {"meshing": "segmentation"})  # meshed again
            case.biometry("od"), case.eye("od")
            for read in (case.wavefront, case.prescription):
                with self.assertRaisesRegex(emmetrope.InputError, "raytrace was made from another meshing") as caught:
                    read("od")
                self.assertIn("emmetrope trace", caught.exception.remedy)

    def test_an_age_that_is_not_the_studys_is_warned_of(self):
        with tempfile.TemporaryDirectory() as folder:
            case = emmetrope.Case(make_fixture_case(os.path.join(folder, "case")))
            age_years = json.loads(pathlib.Path(case.folder, "case.json").read_text())["subject"]["age_years"]
            with self.assertWarnsRegex(UserWarning, "age"):
                case.eye("od", age_years=age_years + 20)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                case.eye("od", age_years=age_years)
                with self.assertRaises(UserWarning):
                    case.eye("od", age_years=age_years + 20)


class Module(unittest.TestCase):
    def test_keeps_no_memory(self):
        eye = emmetrope.Eye("navarro")
        origin, direction = numpy.tile([0.0, 1.0, 10.0], (64, 1)), numpy.tile([0.0, 0.0, -1.0], (64, 1))

        def work(times):
            for _ in range(times):
                emmetrope.trace_rays(eye, origin, direction, threads=1)
                eye.to_dict()
                eye.with_pupil(3).cardinal_points()
                try:
                    emmetrope.Eye("nobody")
                except emmetrope.UsageError:
                    pass
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

        before_kib = work(500)
        self.assertLess(work(10000) - before_kib, 4096)

    def test_stubs_name_what_there_is(self):
        stubs = ast.parse(pathlib.Path(emmetrope.__file__).with_name("__init__.pyi").read_text())
        names, members = set(), {}
        for node in stubs.body:
            if isinstance(node, ast.ClassDef):
                names.add(node.name)
                members[node.name] = {m.target.id if isinstance(m, ast.AnnAssign) else m.name for m in node.body
                                      if isinstance(m, (ast.AnnAssign, ast.FunctionDef))}
            elif isinstance(node, ast.FunctionDef):
                names.add(node.name)
            elif isinstance(node, ast.AnnAssign):
                names.add(node.target.id)
            elif isinstance(node, ast.ImportFrom) and node.level == 1:
                names.update(alias.asname for alias in node.names)
        self.assertEqual(names, {name for name in dir(emmetrope) if not name.startswith("_")} - {"cases"})
        for name in names & members.keys():
            kind = getattr(emmetrope, name)
            if issubclass(kind, Exception):
                continue
            there = {member for member in vars(kind) if not member.startswith("_")}
            set_by_instances = {"folder"}
            self.assertEqual({m for m in members[name] if not m.startswith("_")} - set_by_instances, there, name)


if __name__ == "__main__":
    unittest.main()
