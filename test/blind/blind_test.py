#!/usr/bin/python3
"""Tests of the truth generator: laws against closed forms, effects, noise, seeds; and no record tells its truth."""

import json
import math
import os
import re
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import effects  # noqa: E402
import make_records  # noqa: E402
from reduced_rig import (GRAVITY_MPS2, WATER_DENSITY_KGPM3, Ice, PullUp, Rig, hoist_command, stable_slope,  # noqa: E402
                         wall_pressure_ratio)

# Quiet until 1 s, lift to 5 s, hold to 8 s, lift to 16 s, hold to 20 s; fast, so that the tests are.
SHORT_LIFT = hoist_command([(1.0, 0.0), (4.0, 0.1), (3.0, 0.0), (8.0, 0.19), (4.0, 0.0)])
COARSE = Rig(field_radius_m=2.2, spacing_m=0.25)  # for the effects, of which it shows direction and size as well


def mean(result, values, begin_s, end_s):
    return float(values[(result.time_s >= begin_s) & (result.time_s < end_s)].mean())


def ice_peak_n(ice=None, seed=1, rig=None, speed_mps=0.1):
    result = PullUp(ice or Ice(), seed, rig).run(hoist_command([(1.0, 0.0), (1.8 / speed_mps, speed_mps)]))
    return float(np.convolve(result.components["ice_n"], np.ones(50) / 50.0, mode="valid").max())


class ReducedModel(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = PullUp(Ice(), 1)
        cls.result = cls.model.run(SHORT_LIFT)

    def test_bad_ice_is_refused_by_name(self):
        for key, value in (("thickness_m", 0.0), ("void_fraction", 1.0), ("cohesion_pa", -1.0),
                           ("friction_angle_deg", 80.0), ("density_kgpm3", 1001.0)):
            with self.assertRaisesRegex(ValueError, key):
                Ice(**{key: value})

    def test_wall_pressure_follows_krynine_and_slope_culmann(self):
        self.assertAlmostEqual(wall_pressure_ratio(30.0), 0.6)  # cos²φ / (1 + sin²φ) = 0.75 / 1.25
        # 4 c sin 60° cos 30° / (γ (1 - cos 30°)) with c = 10 Pa, γ = 1 kN/m³
        self.assertAlmostEqual(stable_slope(10.0, 30.0, 1000.0, 0.223923), math.tan(math.pi / 3.0), places=4)
        self.assertAlmostEqual(stable_slope(0.0, 40.0, 1000.0, 1.0), math.tan(math.radians(40.0)), places=4)

    def test_floating_ice_weighs_nothing_and_dips_by_archimedes(self):
        self.assertAlmostEqual(PullUp(Ice(density_kgpm3=870.0), 1).draft_ratio(), 0.87)
        gradient = PullUp(Ice(), 1, effects=[effects.PorosityGradient(1.0, np.random.default_rng(1))])
        self.assertLess(gradient.draft_ratio(), 0.9)
        self.assertAlmostEqual(float(gradient.solid_below(gradient.draft_ratio())), 0.9)
        self.assertAlmostEqual(mean(self.result, self.result.components["ice_n"], 0.2, 0.9), 0.0, delta=1.0)

    def test_lifted_plug_weighs_its_dry_ice(self):
        carried = self.model.base > 0.1
        volume_m3 = self.model.area * self.model.height[carried].sum()
        self.assertGreater(volume_m3, 2.0)
        self.assertAlmostEqual(mean(self.result, self.result.components["ice_n"], 19.0, 20.0),
                               900.0 * 0.4 * 9.81 * volume_m3, delta=0.005 * 900.0 * 0.4 * 9.81 * volume_m3)

    def test_without_strength_the_force_is_the_lost_buoyancy(self):
        model = PullUp(Ice(cohesion_pa=1e-6, friction_angle_deg=1e-6), 1)
        model.slope = 1e6
        start_m = model.base.copy()
        result = model.run(hoist_command([(0.5, 0.0), (8.0, 0.1), (2.0, 0.0)]))
        raised = model.base > start_m + 1e-3
        emerged_m3 = model.area * (model.base - start_m)[raised].sum()
        self.assertGreater(emerged_m3, 1.0)
        self.assertLess(model.base[raised].max(), 0.0)
        self.assertAlmostEqual(mean(result, result.components["ice_n"], 10.0, 10.5),
                               WATER_DENSITY_KGPM3 * 0.4 * GRAVITY_MPS2 * emerged_m3, delta=20.0)

    def test_at_standstill_the_force_stays(self):
        result = PullUp(Ice(), 1).run(hoist_command([(1.0, 0.0), (6.2, 0.1), (20.0, 0.0)]))
        ice = result.components["ice_n"]
        level = mean(result, ice, 20.0, 27.0)
        self.assertGreater(level, 8000.0)
        self.assertLess(np.abs(ice[result.time_s > 17.0] - level).max(), 0.003 * level)

    def test_empty_rig_weighs_its_mass_less_its_buoyancy(self):
        model = PullUp(Ice(), 1)
        result = model.run(SHORT_LIFT, empty=True)
        pole_m3 = math.pi * 0.05**2 * -model.start_height_m
        self.assertAlmostEqual(mean(result, result.tension_n, 0.2, 0.9), 9.81 * (240.0 - 1000.0 * (0.02 + pole_m3)),
                               delta=0.1)
        self.assertAlmostEqual(mean(result, result.tension_n, 19.0, 20.0), 9.81 * 240.0, delta=0.1)

    def test_sliding_ice_is_not_lost(self):
        self.assertAlmostEqual(self.model.height.sum() / PullUp(Ice(), 1).height.sum(), 1.0, places=12)

    def test_peak_responds_to_ice_and_rig(self):
        peak = ice_peak_n()
        for changed in (Ice(void_fraction=0.5), Ice(cohesion_pa=600.0), Ice(thickness_m=1.4)):
            self.assertGreater(ice_peak_n(changed), 1.05 * peak, changed)
        self.assertLess(ice_peak_n(rig=Rig(radius_m=1.0)), 0.8 * peak)
        self.assertAlmostEqual(ice_peak_n(speed_mps=0.15) / peak, 1.0, delta=0.08)  # no rate in the baseline

    def test_seed_decides_all(self):
        again, other = PullUp(Ice(), 1).run(SHORT_LIFT), PullUp(Ice(), 2).run(SHORT_LIFT)
        np.testing.assert_array_equal(again.tension_n, self.result.tension_n)
        self.assertGreater(np.abs(other.tension_n - self.result.tension_n).max(), 100.0)


class Effects(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.plain = PullUp(Ice(), 1, COARSE).run(SHORT_LIFT)

    def change(self, cls, severity=1.0, **arguments):
        """The effect, the lift with it, and what it adds to the tension."""
        effect = cls(severity, np.random.default_rng(7), **arguments)
        result = PullUp(Ice(), 1, COARSE, effects=[effect]).run(SHORT_LIFT)
        return effect, result, result.tension_n - self.plain.tension_n

    def assert_mean(self, cls, begin_s, end_s, low_n, high_n, **arguments):
        _, result, change = self.change(cls, **arguments)
        value = mean(result, change, begin_s, end_s)
        self.assertTrue(low_n <= value <= high_n, f"{cls.name}: {value:.1f} N")

    def test_zero_severity_is_bit_identical(self):
        for order in (effects.ALL, effects.ALL[::-1]):
            zero = [cls(0.0, np.random.default_rng(7)) for cls in order]
            np.testing.assert_array_equal(PullUp(Ice(), 1, COARSE, effects=zero).run(SHORT_LIFT).tension_n,
                                          self.plain.tension_n)

    def test_negative_severity_is_refused(self):
        with self.assertRaisesRegex(ValueError, "severity"):
            effects.Drainage(-1.0, np.random.default_rng(1))

    def test_ice_effects_act_as_they_should(self):
        self.assert_mean(effects.FreezeBonds, 1.5, 2.5, 200.0, 8000.0)  # a higher break-out
        self.assert_mean(effects.BlockDrop, 11.0, 12.0, -4000.0, -300.0, times_s=(9.0,))
        self.assert_mean(effects.PorosityGradient, 4.0, 5.0, -3000.0, -100.0)  # the light top emerges first
        self.assert_mean(effects.RateDependence, 3.0, 5.0, 100.0, 4000.0)
        self.assert_mean(effects.Refreezing, 8.2, 9.0, 100.0, 6000.0)  # a second break-out after the stop
        _, _, change = self.change(effects.ThicknessField)
        self.assertGreater(np.abs(change).max(), 300.0)

    def test_drained_water_leaves_with_the_root_of_time(self):
        effect, result, change = self.change(effects.Drainage)
        self.assertGreater(mean(result, change, 4.0, 5.0), 100.0)
        # Water from one instant: what the class adds to a made-up history of 1 m³ that emerges at once.
        result.components["emerged_m3"] = np.ones_like(result.time_s)
        result.tension_n = np.zeros_like(result.time_s)
        effect.after(PullUp(Ice(), 1, COARSE), result)
        full_n = 1000.0 * 9.81 * 0.6 * effect.parameters["held_ratio"]
        quarter = np.searchsorted(result.time_s, 0.25 * effect.parameters["duration_s"])
        self.assertAlmostEqual(result.tension_n[0], full_n, delta=1e-6)
        self.assertAlmostEqual(result.tension_n[quarter], 0.5 * full_n, delta=0.01 * full_n)

    def test_motion_effects_act_as_they_should(self):
        effect, result, change = self.change(effects.VesselHeave)
        heave = np.array([effect.suspension(time, 0.0, 0.0)[2] for time in result.time_s])
        early = result.time_s < 4.0
        self.assertGreater(np.corrcoef(heave[early] - heave[0], change[early])[0, 1], 0.5)
        self.assertLess(np.abs(result.hoist_position_m - result.hoist_position_m[0])[result.time_s < 0.9].max(), 1e-9)
        _, result, change = self.change(effects.CraneSpeed)
        self.assertLess(result.hoist_position_m[-1], self.plain.hoist_position_m[-1] - 0.05)
        effect, result, _ = self.change(effects.PoleTilt)
        self.assertEqual(np.abs(self.plain.lateral_n).max(), 0.0)
        toward = result.lateral_n @ [math.cos(effect.parameters["azimuth_rad"]), math.sin(
            effect.parameters["azimuth_rad"])]
        self.assertGreater(toward.max(), 100.0)
        self.assert_mean(effects.Compliance, 3.0, 5.0, -3000.0, -50.0)  # the stretching rope is behind
        _, result, _ = self.change(effects.RopeCreep)
        self.assertLess(result.components["hub_m"][-1], self.plain.components["hub_m"][-1] - 0.01)
        self.assert_mean(effects.CollectorHydrodynamics, 2.0, 4.5, 550.0, 650.0)  # 2000 · 0.1 + 40000 · 0.1² N
        self.assert_mean(effects.CollectorHydrodynamics, 6.0, 7.9, -1.0, 1.0)

    def test_sea_does_not_begin_with_the_record(self):
        effect = effects.VesselHeave(1.0, np.random.default_rng(7))
        effect.parameters["phases_rad"] = [0.5 * math.pi, 0.5 * math.pi]  # both lines at their crests
        tension = PullUp(Ice(), 1, COARSE, effects=[effect]).run(hoist_command([(1.0, 0.0)])).tension_n
        self.assertLess(np.abs(np.diff(tension)).max(), 200.0)

    def test_sensor_effects_act_as_they_should(self):
        self.assert_mean(effects.LoadCellBias, 0.0, 20.0, 899.99, 900.01)
        _, result, change = self.change(effects.LoadCellDrift)
        self.assertGreater(np.diff(change).min(), 0.0)
        self.assertAlmostEqual(change[0], 0.0, delta=2.0)
        _, result, change = self.change(effects.LoadCellScale)
        self.assertAlmostEqual(mean(result, change, 0.2, 0.9), 0.0, delta=1.0)
        load = mean(result, self.plain.tension_n, 19.0, 20.0) - effects.empty_tension(PullUp(Ice(), 1, COARSE))
        self.assertAlmostEqual(mean(result, change, 19.0, 20.0), 0.2 * load * (1.0 - 1e-5 * load), delta=5.0)
        self.assert_mean(effects.LoadCellLag, 2.0, 5.0, -5000.0, -200.0)
        self.assert_mean(effects.LoadCellLag, 0.2, 0.9, -1.0, 1.0)

    def test_unknown_effects_act_as_they_should(self):
        self.assertGreaterEqual(sum(cls.name.startswith("unknown:") for cls in effects.ALL), 5)
        for cls, sign in ((effects.StickSlip, 1.0), (effects.WaveSlap, -1.0), (effects.CrewStepping, 1.0),
                          (effects.HullSnag, 1.0)):
            _, _, change = self.change(cls)
            self.assertGreaterEqual((sign * change).min(), -1e-6, cls.name)
            self.assertGreater((sign * change).max(), 300.0, cls.name)
        effect, result, change = self.change(effects.DrumRipple)
        self.assertAlmostEqual(mean(result, change, 0.0, 0.9), 0.0, delta=1e-6)
        ratio = change / self.plain.tension_n
        self.assertAlmostEqual(np.abs(ratio).max(), effect.parameters["ratio"], delta=1e-3)


class Records(unittest.TestCase):
    def test_noise_is_white_plus_one_over_f(self):
        slopes = {}
        for kind, white_n, pink_n in (("white", 100.0, 0.0), ("pink", 0.0, 100.0)):
            samples = make_records.noise(2**16, 50.0, white_n, pink_n, np.random.default_rng(5))
            self.assertAlmostEqual(samples.std(), 100.0, delta=2.0)
            power = (np.abs(np.fft.rfft(samples.reshape(32, -1) * np.hanning(2048)))**2).mean(axis=0)
            band = slice(8, 800)  # 0.2 to 20 Hz
            slopes[kind] = np.polyfit(np.log(np.arange(1025)[band]), np.log(power[band]), 1)[0]
        self.assertAlmostEqual(slopes["white"], 0.0, delta=0.1)
        self.assertAlmostEqual(slopes["pink"], -1.0, delta=0.1)

    def test_seeds_of_purposes_and_runs_are_disjoint(self):
        used = [make_records.seeds(purpose, seed) for purpose in ("tune", "test")
                for seed in (0, 1, make_records.MAX_SEED - 1)]
        self.assertEqual(len(set().union(*used)), sum(len(each) for each in used))
        self.assertLess(make_records.seeds("tune", make_records.MAX_SEED - 1)[-1], make_records.seeds("test", 0)[0])
        for seed in (-1, make_records.MAX_SEED):
            with self.assertRaisesRegex(ValueError, "seed"):
                make_records.seeds("test", seed)
        jobs = make_records.suite_jobs("test", 1)[0] + make_records.null_jobs("test", 1, 60)[0]
        jobs += make_records.demo_jobs("test", 1)[0]
        own = [job.own_seed for job in jobs]
        self.assertEqual(len(set(own)), len(own))
        self.assertTrue(set(own) | {job.shared_seed for job in jobs} <= set(make_records.seeds("test", 1)))

    def test_suite_has_every_case_with_fit_holdout_and_null(self):
        jobs, index = make_records.suite_jobs("test", 1)
        wanted = """none_plain none_other_ice none_strong_pink none_reversal clock_error drainage_strong drainage_weak
            break_out two_drops two_line_swell speed_loss_encoder speed_loss_commanded tilt_lateral tilt_plain
            bias_with_empty scale_alone lag_stop rate_alone rate_stop refreezing_two_waits compliance thickness
            drum_ripple stick_slip drop_and_bias drainage_and_swell""".split()
        self.assertLessEqual(set(wanted), set(index))
        made = {(job.case.name, job.role, job.with_effects) for job in jobs}
        for name in index:
            for role in ("fit", "holdout"):
                self.assertTrue({(name, role, True), (name, role, False)} <= made, name)
        known = set("""drainage freeze_bonds block_drop vessel_heave crane_speed pole_tilt load_cell_bias
            load_cell_drift load_cell_scale load_cell_lag collector_hydrodynamics porosity_gradient thickness_field rate_dependence
            compliance refreezing""".split())
        self.assertEqual({cls.name for cls in effects.ALL if not cls.name.startswith("unknown:")}, known)
        nulls, _ = make_records.null_jobs("test", 1, 60)
        for procedure in ("lift", "stop_and_hold", "lower_lift"):
            self.assertEqual(sum(job.procedure == procedure for job in nulls), 60)
        self.assertFalse(any(job.case.effects for job in nulls))
        with self.assertRaisesRegex(ValueError, "nulls"):
            make_records.null_jobs("test", 1, 0)

    def test_a_directory_with_records_is_left_alone(self):
        with tempfile.TemporaryDirectory() as directory:
            make_records.write([], {}, directory, 1)
            with self.assertRaises(FileExistsError):
                make_records.write([], {}, directory, 1)

    def test_no_record_tells_its_truth(self):
        jobs, _ = make_records.suite_jobs("tune", 0)
        self.assertEqual(len({job.name for job in jobs}), len(jobs))
        texts = {job.name: make_records.manifest(job) for job in jobs}
        neutral = {re.sub(r"title: .*\n|position: .*\n", "", text) for text in texts.values()}
        self.assertEqual(len(neutral), 1)
        for job in jobs:
            number, role = re.fullmatch(r"case_(\d{4})_(fit|holdout|extra)", job.name).groups()
            self.assertIn(f"title: Pull-up test {number}, {role} record\n", texts[job.name])
        for what in (lambda case: case.lateral, lambda case: case.position == "commanded"):
            self.assertGreater(len({case.expected for case in make_records.CASES if what(case)}), 2)

        words = [case.name for case in make_records.CASES] + [
            word for cls in effects.ALL for word in cls.name.split(":")]
        chosen = [job for job in jobs if job.procedure == "empty"]
        with tempfile.TemporaryDirectory() as directory:
            os.makedirs(os.path.join(directory, "sealed"))
            for job in chosen:
                make_records.make_record(job, directory)
            names = {job.name for job in chosen}
            self.assertEqual(set(os.listdir(directory)),
                             {f"{name}.{end}" for name in names for end in ("csv", "yaml")} | {"sealed"})
            for name in names:
                with open(os.path.join(directory, f"{name}.csv"), encoding="utf-8") as file:
                    text = file.read()
                self.assertEqual([word for word in words if word in text], [])
                rows = np.genfromtxt(os.path.join(directory, f"{name}.csv"), delimiter=",", names=True)
                self.assertEqual(rows.dtype.names, ("time_s", "force_n", "hoist_position_m", "hoist_speed_mps"))
                self.assertTrue(np.allclose(np.diff(rows["time_s"]), 0.02))
                with open(os.path.join(directory, "sealed", f"{name}.json"), encoding="utf-8") as file:
                    sealed = json.load(file)
                quiet = rows["force_n"][rows["time_s"] < sealed["quiet_s"]]
                expected_n = sum(effect["parameters"]["bias_n"] for effect in sealed["effects"])
                self.assertAlmostEqual(quiet.mean(), expected_n, delta=100.0)
                self.assertIn(expected_n, (0.0, 900.0))
                self.assertEqual(np.abs(rows["force_n"] % 10.0).max(), 0.0)


if __name__ == "__main__":
    unittest.main()
