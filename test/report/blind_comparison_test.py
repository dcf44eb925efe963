#!/usr/bin/python3
"""Tests of the comparison with the sealed truth (scripts/blind_comparison.py, blind_suite.py, validate, demo_identify)
on made-up reports and truths, with a program that only plays brash_ice."""

import json
import math
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest

import numpy as np

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCRIPTS = os.path.join(SOURCE_DIR, "scripts")
sys.dont_write_bytecode = True
sys.path[:0] = [SCRIPTS, os.path.dirname(os.path.abspath(__file__)), os.path.join(SOURCE_DIR, "test", "blind")]

import blind_comparison  # noqa: E402
import blind_suite  # noqa: E402
import effects as blind_effects  # noqa: E402
import identify_data  # noqa: E402
from blind_comparison import Case, Null, Removal  # noqa: E402
from made_report import curves, made_report  # noqa: E402

TRUE_PARAMETERS = {
    "drainage": {"held_ratio": 0.3, "duration_s": 20.0},
    "load_cell_bias": {"bias_n": 900.0},
    "load_cell_lag": {"lag_s": 1.5},
    "block_drop": {"drops": [{"time_s": 23.2, "mass_kg": 170.0}, {"time_s": 21.0, "mass_kg": 200.0}]},
    "vessel_heave": {"amplitudes_m": [0.05, 0.03], "periods_s": [7.0, 4.5], "phases_rad": [0.0, 1.0]},
    "crane_speed": {"loss_ratio_at_12kn": 0.14},
    "porosity_gradient": {"solid_contrast": 0.5},
    "compliance": {"softness_mpn": 1.0 / 120000.0, "closing_m": 0.2},
    "load_cell_scale": {"scale_error_ratio": 0.2, "bend_per_n": 1e-5},
}


def sealed(names=("drainage",), expected="effect", **of_curves):
    """A sealed file of the same lift as the made report's series, at 10 Hz and with another zero of time and load."""
    made = curves(**of_curves)
    time_s = np.arange(0.0, 44.7, 0.1)
    at = made["series"]["time_s"]
    return {"expected_verdict": expected, "ice": {"void_fraction": 0.6}, "procedure": "lift",
            "effects": [{"name": name, "severity": 1.0, "parameters": TRUE_PARAMETERS.get(name, {})}
                        for name in names],
            "clean": {"time_s": (time_s + 6.5).tolist(),
                      "force_n": (np.interp(time_s, at, made["clean"]) - 2000.0).tolist(),
                      "force_without_effects_n": (np.interp(time_s, at, made["plain"]) - 2000.0).tolist()}}


def report(**arguments):
    return identify_data.REPORT(made_report(**arguments), "")


def case(names=("drainage",), expected="effect", verdict="effect", effects=None, name="a_case", **more):
    said = report(verdict=verdict, effects=effects) if verdict else None
    return Case(name, expected, sealed(names, expected), sealed(names, expected, speed_mps=0.045, seed=2),
                report=said, **more)


def ranked_parameters(**values):
    """An entry's parameters as {name: (value, low, high)}."""
    return [{"key": f"effects.x.{name}", "unit": "1", "value": value, "low": low, "high": high, "prior_low": 0.0,
             "prior_high": 1.0} for name, (value, low, high) in values.items()]


class Outcomes(unittest.TestCase):
    def test_each_pair_of_truth_and_verdict_has_its_outcome(self):
        two, unknown = ("drainage", "vessel_heave"), ("unknown:drum_ripple",)
        for truth, expected, verdict, effects, wanted in (
                (("drainage",), "effect", "effect", ["drainage"], "right"),
                (("drainage",), "effect", "effect", ["block_drop"], "wrong"),
                (("drainage",), "effect", "effect", ["block_drop", "drainage"], "too many"),
                (("drainage",), "effect", "tie", ["block_drop", "drainage"], "in a set"),
                (("drainage",), "effect", "tie", ["a", "b", "c", "drainage"], "in a large set"),
                (("drainage",), "effect", "tie", ["block_drop", "a"], "wrong"),
                (("drainage",), "effect", "unknown", [], "unknown"),
                (("drainage",), "effect", "none", [], "none"),
                (("drainage",), "effect", "cannot_tell", [], "cannot tell"),
                (("drainage",), "effect", None, [], "failed"),
                (("load_cell_scale",), "tie", "tie", ["load_cell_bias", "load_cell_scale"], "in a set"),
                (("load_cell_scale",), "tie", "effect", ["load_cell_scale"], "right"),
                (two, "effect", "effect", ["vessel_heave", "drainage"], "right"),
                (two, "effect", "effect", ["drainage"], "part"),
                (two, "effect", "effect", ["drainage", "block_drop"], "wrong"),
                (unknown, "unknown", "unknown", [], "right"),
                (unknown, "unknown", "effect", ["vessel_heave"], "named"),
                (unknown, "unknown", "none", [], "none"),
                (("crane_speed",), "none", "none", [], "right"),
                ((), "none", "tie", ["a", "b"], "named"),
                ((), "none", "unknown", [], "unknown")):
            with self.subTest(f"{truth} {verdict} {effects}"):
                outcome = blind_comparison.outcome(case(truth, expected, verdict, effects))
                self.assertEqual(outcome, wanted)
                self.assertIn(outcome, blind_comparison.OUTCOMES)


class Removed(unittest.TestCase):
    def test_curves_are_lined_up_over_another_zero_of_time_and_load(self):
        made = curves()
        reading, without = blind_comparison.line_up(sealed(), made["series"])
        # The offset is known as well as the mean of 180 samples of 80 N, the time to 0.02 s.
        self.assertLess(np.abs(reading - made["clean"]).max(), 4.0 * 80.0 / math.sqrt(180.0))
        np.testing.assert_allclose(reading - without, made["clean"] - made["plain"], atol=10.0)

    def test_another_record_is_not_taken_for_this_one(self):
        with self.assertRaisesRegex(ValueError, "differ by"):
            blind_comparison.line_up(sealed(effect_n=4000.0), curves()["series"])

    def test_a_report_that_compared_nothing_removed_nothing(self):
        empty = {key: np.array([]) for key in curves()["series"]}
        one = case()
        one.report["series"] = empty
        self.assertIsNone(blind_comparison.removals(one)[0])

    def test_share_follows_from_what_is_left(self):
        # Refitting leaves 0.75 of a hump, the effect 0.1 of it (to the accuracy of lining up): the share there was to
        # remove is 0.75², and (0.75² - 0.1²) was.
        made = curves(effect_n=3000.0, left_n=300.0)
        found = blind_comparison.removal(sealed(effect_n=3000.0, left_n=300.0), made["series"])
        self.assertAlmostEqual(found.reachable / found.explainable, 0.75**2, delta=0.02)
        self.assertAlmostEqual(found.share, 1.0 - 0.1**2 / 0.75**2, delta=0.01)

    def test_nothing_is_removed_where_nothing_was_accepted_and_less_than_nothing_by_a_wrong_curve(self):
        self.assertEqual(blind_comparison.removal(sealed(), curves(after=False)["series"]).share, 0.0)
        self.assertLess(blind_comparison.removal(sealed(left_n=2000.0), curves(left_n=2000.0)["series"]).share, -1.0)

    def test_no_more_can_be_removed_than_the_effect_itself(self):
        self.assertEqual(Removal(explainable=4.0, before=10.0, after=6.0).share, 1.0)
        self.assertEqual(Removal(explainable=8.0, before=4.0, after=1.0).share, 0.75)
        self.assertTrue(math.isnan(Removal(explainable=0.0, before=4.0, after=1.0).share))


class Parameters(unittest.TestCase):
    def amount(self, name):
        return blind_comparison.true_amounts(sealed((name,)))[name]

    def test_truth_in_the_terms_of_the_library(self):
        self.assertEqual(self.amount("drainage"), ("held_ratio", 0.3))
        self.assertEqual(self.amount("load_cell_bias"), ("bias_n", 900.0))
        self.assertEqual(self.amount("load_cell_lag"), ("lag_s", 1.5))
        self.assertEqual(self.amount("crane_speed"), ("loss_ratio", 0.14))
        self.assertEqual(self.amount("block_drop"), ("mass_1_kg", 200.0))
        # Solid share 0.6 at the bottom and 0.2 at the top; the line through cos(pi d) has 24 / pi² = 2.43 for 2.
        key, contrast = self.amount("porosity_gradient")
        self.assertEqual(key, "contrast")
        depth = (np.arange(20000) + 0.5) / 20000.0
        void_fraction = 1.0 - 0.4 * (1.0 + 0.5 * np.cos(np.pi * (1.0 - depth)))
        self.assertAlmostEqual(contrast, np.polyfit(depth, void_fraction, 1)[0], places=5)

    def test_forms_that_differ_are_replaced_by_the_nearest_of_the_library(self):
        # Readings of 1000 and 2000 N, of which the truth makes 1100 and 2300: least squares give 0.14.
        truth = sealed(("load_cell_scale",))
        truth["clean"].update(time_s=[0.0, 1.0], force_n=[1100.0, 2300.0], force_without_effects_n=[1000.0, 2000.0])
        self.assertAlmostEqual(blind_comparison.true_amounts(truth)["load_cell_scale"][1], 0.14)
        # x = 0.1 (sqrt(1 + 4 F / (120000 · 0.2)) - 1) m: at 6000 N 41.4 mm, so 6.90e-6 m/N.
        truth = sealed(("compliance",))
        truth["clean"].update(time_s=[0.0, 1.0], force_n=[0.0, 6000.0], force_without_effects_n=[0.0, 6000.0])
        self.assertAlmostEqual(blind_comparison.true_amounts(truth)["compliance"][1], 6.9036e-6, delta=1e-9)

    def test_every_effect_of_the_truth_is_compared_or_left_out_with_a_reason(self):
        for effect in blind_effects.ALL:
            if effect.name.startswith(blind_comparison.UNKNOWN_PREFIX):
                continue
            with self.subTest(effect.name):
                parameters = effect(1.0, np.random.default_rng(1)).parameters
                truth = {**sealed(), "effects": [{"name": effect.name, "parameters": parameters}]}
                compared = effect.name in blind_comparison.true_amounts(truth)
                self.assertNotEqual(compared, effect.name in blind_comparison.NOT_COMPARED)

    def with_entry(self, names, confirmed=True, **parameters):
        one = case(names, effects=list(names))
        one.report["ranking"][0].update(parameters=ranked_parameters(**parameters), confirmed=confirmed)
        return one

    def test_intervals_hold_the_truth_or_do_not(self):
        found = blind_comparison.coverage(self.with_entry(("drainage",), held_ratio=(0.25, 0.2, 0.31)))
        self.assertEqual([(one.parameter, one.truth, one.inside) for one in found], [("held_ratio", 0.3, True)])
        found = blind_comparison.coverage(self.with_entry(("drainage",), held_ratio=(0.25, 0.2, 0.29)))
        self.assertEqual([one.inside for one in found], [False])

    def test_intervals_without_a_full_simulation_or_of_other_effects_do_not_count(self):
        values = {"held_ratio": (0.25, 0.2, 0.31)}
        self.assertEqual(blind_comparison.coverage(self.with_entry(("drainage",), confirmed=False, **values)), [])
        self.assertEqual(blind_comparison.coverage(self.with_entry(("pole_tilt",), **values)), [])

    def test_blocks_are_compared_in_the_order_of_their_falls(self):
        found = blind_comparison.coverage(self.with_entry(
            ("block_drop",), mass_1_kg=(165.0, 150.0, 180.0), time_1_s=(16.0, 15.0, 17.0), mass_2_kg=(5.0, 0.0, 30.0),
            time_2_s=(30.0, 0.0, 40.0), mass_3_kg=(210.0, 190.0, 230.0), time_3_s=(14.0, 13.0, 15.0)))
        self.assertEqual([(one.parameter, one.truth, one.inside) for one in found],
                         [("mass_3_kg", 200.0, True), ("mass_1_kg", 170.0, True)])

    def test_a_fall_that_was_found_for_two_has_the_mass_of_both(self):
        found = blind_comparison.coverage(self.with_entry(
            ("block_drop",), mass_1_kg=(390.0, 290.0, 560.0), time_1_s=(14.0, 13.0, 15.0)))
        self.assertEqual([(one.parameter, one.truth, one.inside) for one in found], [("mass_1_kg", 370.0, True)])

    def test_swell_is_compared_by_nearest_period(self):
        found = blind_comparison.coverage(self.with_entry(
            ("vessel_heave",), amplitude_1_m=(0.03, 0.02, 0.04), period_1_s=(4.4, 4.3, 4.6),
            amplitude_2_m=(0.03, 0.02, 0.04), period_2_s=(7.1, 6.9, 7.3)))
        self.assertEqual([(one.parameter, one.truth, one.inside) for one in found],
                         [("amplitude_2_m", 0.05, False), ("period_2_s", 7.0, True), ("amplitude_1_m", 0.03, True),
                          ("period_1_s", 4.5, True)])


class Detectability(unittest.TestCase):
    def test_is_the_larger_of_what_was_fitted_and_what_the_truth_is_worth(self):
        one = case(("drainage",))
        self.assertEqual(blind_comparison.detectability(one), 14.2)
        one.report["ranking"][0]["detectability"] = 0.5
        one.report["minimum_detectable"] = [{"name": "drainage", "key": "effects.drainage.held_ratio", "unit": "1",
                                             "value": 0.1, "expected_detectability": 7.0}]
        self.assertAlmostEqual(blind_comparison.detectability(one), 15.0)

    def test_of_two_effects_the_weaker_counts_and_without_a_report_none(self):
        one = case(("drainage", "vessel_heave"), effects=["drainage", "vessel_heave"])
        self.assertEqual(blind_comparison.detectability(one), 0.6)
        self.assertTrue(math.isnan(blind_comparison.detectability(case(verdict=None))))
        self.assertTrue(math.isnan(blind_comparison.detectability(case((), "none", "none"))))


class Aims(unittest.TestCase):
    def setUp(self):
        cases = [case(name="right"), case(effects=["block_drop"], name="wrong"),
                 case(verdict="tie", effects=["block_drop", "drainage"], name="tied", record_count=2),
                 case(verdict=None, name="broken", failure="exit code 1: out of ice"),
                 case(("vessel_heave",), verdict="none", name="weak"),  # d' below 8
                 case(("unknown:drum_ripple",), "unknown", "unknown", name="ripple"),
                 case(("unknown:hull_snag",), "unknown", "effect", ["compliance"], name="snag"),
                 case((), "none", "none", name="nothing")]
        nulls = [Null(f"null_{number}", "lift", verdict, []) for number, verdict in enumerate(
            ["none"] * 16 + ["effect", "unknown", "cannot_tell", "failed"])]
        nulls[-1].failure = "exit code 2: no"
        nulls[16].named = ["load_cell_drift"]
        self.result = blind_comparison.evaluate(cases, nulls)

    def aim(self, words):
        found, = [aim for aim in self.result.aims if words in aim.text]
        return found

    def test_known_effects_count_by_their_records_and_a_broken_case_is_a_miss(self):
        # "weak" is below d' 8, "tied" has two records; of right, wrong, broken one is found.
        one, two = self.aim("one record"), self.aim("two or more")
        self.assertEqual((one.hits, one.total, one.reached), (1, 3, False))
        self.assertEqual((two.hits, two.total, two.reached), (1, 1, True))

    def test_wrong_singletons_are_a_share_of_the_singletons(self):
        aim = self.aim("wrong singletons")
        self.assertEqual((aim.hits, aim.total, aim.reached), (1, 2, False))

    def test_unknown_and_false_positives(self):
        aim = self.aim("called unknown")
        self.assertEqual((aim.hits, aim.total, aim.reached), (1, 2, False))
        # Effect and unknown are claims, cannot_tell is none; the failed one is not judged; the case "nothing" is.
        aim = self.aim("false positives")
        self.assertEqual((aim.hits, aim.total, aim.reached), (2, 20, False))
        self.assertIn("1 of them name an effect", aim.detail)

    def test_limits_are_part_of_the_aim_and_no_case_is_no_judgement(self):
        self.assertTrue(blind_comparison.Aim("", 17, 20, 0.85).reached)
        self.assertFalse(blind_comparison.Aim("", 16, 20, 0.85).reached)
        self.assertTrue(blind_comparison.Aim("", 1, 20, 0.05, at_most=True).reached)
        self.assertFalse(blind_comparison.Aim("", 2, 20, 0.05, at_most=True).reached)
        self.assertIsNone(blind_comparison.Aim("", 0, 0, 0.05, at_most=True).reached)

    def test_document_lists_every_case_every_miss_and_every_null(self):
        text = blind_comparison.markdown(self.result, "Made up.")
        for name in self.result.outcomes:
            self.assertRegex(text, rf"(?m)^\| {name} \| ")
        for name in ("wrong", "broken", "weak", "snag"):
            self.assertRegex(text, rf"(?m)^- `{name}` \(")
        for name in ("right", "tied", "ripple", "nothing"):
            self.assertNotRegex(text, rf"(?m)^- `{name}` \(")
        self.assertIn("no report: exit code 1: out of ice", text)
        self.assertIn("| cases without an effect | 1 | 1 | 0 | 0 | 0 | 0 | 0 | – |", text)
        self.assertIn("| lift | 20 | 16 | 1 | 1 | 0 | 1 | 1 | `load_cell_drift` |", text)
        self.assertIn("1 have no report and are not in the share: null_19: exit code 2: no.", text)
        self.assertNotRegex(text, r"\bnan\b")

    def test_tables_have_as_many_cells_as_headings(self):
        width = 0
        for line in blind_comparison.markdown(self.result, "Made up.").splitlines():
            if not line.startswith("|"):
                width = 0
                continue
            cells = line.replace("\\|", "").count("|")
            self.assertEqual(cells, width or cells, line)
            width = cells

    def test_confusion_matrices_count_every_case_once(self):
        lines = blind_comparison.confusion_matrix(self.result).splitlines()
        self.assertEqual(sum(int(line.split("|")[-2]) for line in lines[2:]), len(self.result.cases))
        row, = [line for line in blind_comparison.effect_matrix(self.result).splitlines()
                if line.startswith("| vessel_heave |")]
        self.assertEqual(sum(int(cell) for cell in row.split("|")[2:] if cell.strip()), 1)


PLAYED_PROGRAM = '''#!{python}
"""Plays brash_ice identify: what it says is in verdicts.json, by the number of the case."""
import json, os, sys
sys.path.insert(0, {here!r})
from made_report import made_report, write_made_report
assert sys.argv[1] == "identify", sys.argv
arguments = sys.argv[2:]
records = arguments[:arguments.index("--out")]
for path in [part for part in records if not part.startswith("--")]:
    assert os.path.exists(path), path
    assert not os.path.exists(os.path.join(os.path.dirname(path), "sealed")), "the truth lies open"
with open(os.path.join(os.path.dirname(sys.argv[0]), "calls.txt"), "a") as calls:
    calls.write(" ".join(os.path.basename(part) for part in arguments) + "\\n")
with open(os.path.join(os.path.dirname(sys.argv[0]), "verdicts.json")) as stream:
    verdicts = json.load(stream)
number = os.path.basename(records[0]).split("_")[1]
if number not in verdicts:
    print("this record is garbage", file=sys.stderr)
    sys.exit(2)
write_made_report(arguments[arguments.index("--out") + 1], made_report(verdicts[number]))
'''


class Programs(unittest.TestCase):
    """validate and demo_identify, with records that lie there already and a program that plays brash_ice."""

    def setUp(self):
        self.directory = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.directory)
        self.program = self.path("brash_ice")
        with open(self.program, "w", encoding="utf-8") as stream:
            stream.write(PLAYED_PROGRAM.format(python=sys.executable, here=os.path.dirname(os.path.abspath(__file__))))
        os.chmod(self.program, stat.S_IRWXU)

    def path(self, *parts):
        return os.path.join(self.directory, *parts)

    def write(self, content, *parts):
        os.makedirs(os.path.dirname(self.path(*parts)), exist_ok=True)
        with open(self.path(*parts), "w", encoding="utf-8") as stream:
            stream.write(content if isinstance(content, str) else json.dumps(content))

    def make_truth(self, place, index, records):
        """records: {name: sealed content}."""
        self.write(index, *place, "sealed", "index.json")
        for name, content in records.items():
            self.write("time_s,force_n\n", *place, f"{name}.csv")
            self.write("source: synthetic\n", *place, f"{name}.yaml")
            self.write(content, *place, "sealed", f"{name}.json")

    def call(self, script, *arguments):
        return subprocess.run([sys.executable, "-B", os.path.join(SCRIPTS, script), *arguments, "--program",
                               self.program], capture_output=True, text=True, check=False, cwd=self.directory)

    REFERENCES = {"lift": " --reference case_0021_fit.csv --reference case_0022_fit.csv",
                  "stop_and_hold": " --reference case_0023_fit.csv", "lower_lift": " --reference case_0024_fit.csv"}

    def calls(self):
        with open(self.path("calls.txt"), encoding="utf-8") as stream:
            return stream.read().splitlines()

    def make_references(self, *place):
        self.make_truth((*place, "truth", "references"), {"lift": [21, 22], "stop_and_hold": [23], "lower_lift": [24]},
                        {f"case_00{number}_fit": sealed((), "none", effect_n=0.0) for number in (21, 22, 23, 24)})

    def make_suite(self):
        self.make_references("work")
        truth = ("work", "seed_1", "truth")
        none = sealed((), "none", effect_n=0.0)
        self.make_truth((*truth, "drainage_strong"),
                        {"drainage_strong": {"case": 1111, "null": 1112, "expected_verdict": "effect"}},
                        {"case_1111_fit": sealed(), "case_1111_holdout": sealed(speed_mps=0.045, seed=2),
                         "case_1111_extra": sealed(), "case_1112_fit": none, "case_1112_holdout": none})
        self.make_truth((*truth, "nulls_1"), {"lift": [1113], "stop_and_hold": [1114], "lower_lift": [1115]},
                        {f"case_{number}_fit": none for number in (1113, 1114, 1115)})
        self.write({"1111": "effect", "1112": "none", "1113": "none", "1114": "tie"}, "verdicts.json")

    def validate(self, *more):
        return self.call("validate", "--cases", "drainage_strong", "--nulls", "1", "--work", self.path("work"), *more)

    def test_validate_runs_compares_and_goes_on_where_it_was(self):
        self.make_suite()
        done = self.validate()
        self.assertEqual(done.returncode, 1, done.stderr)  # case 1115 has no report
        self.assertEqual(done.stdout.splitlines()[-1], self.path("work", "validation_identification.md"))
        with open(self.path("work", "validation_identification.md"), encoding="utf-8") as stream:
            text = stream.read()
        self.assertRegex(text, r"\| drainage_strong \| `drainage` \| effect \| effect \| `drainage` \| right \|")
        self.assertIn("exit code 2: this record is garbage", text)
        self.assertIn("| stop and hold | 1 | 0 | 0 | 0 | 1 | 0 | 0 |", text)
        self.assertIn("two or more records: right or in a set of at most 3 | ≥ 90 % | 100 % | 1 of 1 | yes", text)
        self.assertEqual(len(self.calls()), 5)
        self.assertIn("case_1111_fit.csv case_1111_extra.csv --holdout case_1111_holdout.csv --out drainage_strong "
                      "--cache cache" + self.REFERENCES["lift"], self.calls())
        for number, procedure in ((1113, "lift"), (1114, "stop_and_hold"), (1115, "lower_lift")):
            self.assertIn(f"case_{number}_fit.csv --out lone_null_{number} --cache cache" + self.REFERENCES[procedure],
                          self.calls())

        self.write({"1115": "none"}, "verdicts.json")
        done = self.validate()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(len(self.calls()), 6)
        self.assertIn("missed: lone_null_1114", done.stderr)

    def test_references_are_of_the_procedures_of_a_cases_records(self):
        self.make_references("work")
        made = sealed()
        for name, number in (("rate_stop", 1121), ("bias_with_empty", 1122), ("lag_stop", 1123)):
            self.make_truth(("work", "seed_1", "truth", name),
                            {name: {"case": number, "null": 1130, "expected_verdict": "effect"}},
                            {f"case_{number}_fit": made, f"case_{number}_holdout": made, "case_1130_fit": made,
                             "case_1130_holdout": made})
        self.write({"1121": "effect", "1122": "effect", "1123": "effect", "1130": "none"}, "verdicts.json")
        done = self.call("validate", "--cases", "rate_stop,bias_with_empty,lag_stop", "--nulls", "0", "--work",
                         self.path("work"))
        self.assertEqual(done.returncode, 0, done.stderr)
        for number, procedures in ((1121, ("lift", "stop_and_hold")), (1122, ("lift",)), (1123, ("stop_and_hold",))):
            own = [call for call in self.calls() if call.startswith(f"case_{number}")]
            self.assertEqual(len(own), 1)
            self.assertTrue(own[0].endswith("--cache cache" + "".join(self.REFERENCES[p] for p in procedures)), own)

    def test_validate_names_bad_arguments(self):
        for arguments, message in ((["--cases", "no_such"], "no such case: no_such"), (["--nulls", "-1"], "--nulls -1"),
                                   (["--jobs", "0"], "--jobs 0"),
                                   (["--fast", "--cases", "none_plain"], "give one of --fast and --cases")):
            done = self.call("validate", *arguments)
            with self.subTest(message):
                self.assertEqual(done.returncode, 2)
                self.assertIn(message, done.stderr)
        self.program = self.path("nowhere")
        done = self.validate()
        self.assertEqual(done.returncode, 2)
        self.assertIn("no such program", done.stderr)

    def test_demo_marks_its_records_as_synthetic_and_tells_how_to_go_on(self):
        self.make_references("demo")
        self.make_truth(("demo", "truth"), {}, {"demo_fit": sealed(("freeze_bonds", "block_drop", "drainage")),
                                                "demo_holdout": sealed()})
        self.write({"fit.csv": "effect"}, "verdicts.json")
        self.write("effects: {}\n", "demo", "report", "overlay.yaml")
        done = self.call("demo_identify", "--out", "demo")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("SYNTHETIC", done.stdout.splitlines()[0])
        self.assertIn("Verdict on the SYNTHETIC record: effect drainage", done.stdout)
        self.assertIn("What was in it: freeze_bonds, block_drop, drainage", done.stdout)
        self.assertIn(f"roslaunch brash_ice_rig pull_up.launch overlay:={self.path('demo', 'report', 'overlay.yaml')}",
                      done.stdout)
        self.assertEqual(self.calls(), ["demo_fit.csv --holdout demo_holdout.csv --out report" + self.REFERENCES["lift"]])
        self.write({}, "verdicts.json")
        done = self.call("demo_identify", "--out", "demo")
        self.assertEqual(done.returncode, 1)

    def test_records_are_made_whole_or_not_at_all(self):
        with self.assertRaisesRegex(blind_suite.Failure, "no such case: nothing_like_it"):
            blind_suite.make_records(self.path("new"), ["--suite"], "--cases", "nothing_like_it")
        self.assertFalse(os.path.exists(self.path("new")))


if __name__ == "__main__":
    unittest.main()
