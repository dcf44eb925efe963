#!/usr/bin/python3
"""Tests of scripts/identify_report on reports made here."""

import importlib.machinery
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

SOURCE_DIR = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCRIPT = os.path.join(SOURCE_DIR, "scripts", "identify_report")
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(SCRIPT))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import identify_data  # noqa: E402
import identify_figures  # noqa: E402
from made_report import TIES, made_report, write_made_report  # noqa: E402
from page_reader import PageReader  # noqa: E402

loader = importlib.machinery.SourceFileLoader("identify_report", SCRIPT)
identify_report = importlib.util.module_from_spec(importlib.util.spec_from_loader("identify_report", loader))
loader.exec_module(identify_report)


class TemporaryReport(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.directory)

    def page(self, report):
        write_made_report(self.directory, report)
        with open(identify_report.write_report(self.directory), encoding="utf-8") as stream:
            return stream.read()

    def box(self, report):
        """The text of the box that comes first on the page."""
        write_made_report(self.directory, report)
        return PageReader(identify_report.verdict_box(identify_data.read_report(self.directory))).text


class ReportPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.directory)
        cls.report = made_report()
        write_made_report(cls.directory, cls.report)
        with open(identify_report.write_report(cls.directory), encoding="utf-8") as stream:
            cls.page_text = stream.read()
        cls.page = PageReader(cls.page_text)

    def test_verdict_stands_before_every_figure_and_table(self):
        place = self.page_text.index('class="verdict-box"')
        self.assertLess(place, self.page_text.index("<figure"))
        self.assertLess(place, self.page_text.index("<table"))

    def test_has_the_six_figures_with_numbers_and_labels(self):
        captions = re.findall(r"<figcaption>(.*?)</figcaption>", self.page_text, re.DOTALL)
        self.assertEqual([int(re.search(r"Figure (\d+)", caption).group(1)) for caption in captions],
                         [1, 2, 3, 4, 5, 6])
        self.assertEqual(self.page.tags.count("svg"), 6)
        for label in ("time (s)", "load cell (kN)", "way of the hoist (m)", "residual (kN)", "lag (s)",
                      "autocorrelation", "log Bayes factor (natural logarithm)", "with the effect",
                      "95 % of noise and model error", "believed before (95 %)", "ice.cohesion_pa (Pa)"):
            self.assertIn(label, self.page_text)

    def test_asks_for_nothing_from_outside(self):
        for word in ("http", "//www", "<script", "@import", "<!DOCTYPE svg", "xmlns", "<iframe", "<object"):
            self.assertNotIn(word, self.page_text)
        for name, value in self.page.attributes:
            if name in ("src", "href", "xlink:href"):
                self.assertRegex(value, r"^(#|data:)")

    def test_elements_nest_and_ids_are_unique(self):
        self.assertEqual((self.page.faults, self.page.open), ([], []))
        self.assertGreater(len(self.page.ids), 50)
        self.assertEqual(len(self.page.ids), len(set(self.page.ids)))

    def test_three_rows_of_errors_for_fit_and_held_out_are_those_of_the_file(self):
        errors = re.search(r'<table class="errors">(.*?)</table>', self.page_text, re.DOTALL).group(1)
        rows = re.findall(r"<tr><td>(.*?)</td><td class=\"number\">(.*?)</td>", errors)
        expected = [(label, f"{part[key]['rmse_n']:.0f}")
                    for part in (self.report, self.report["holdout"])
                    for key, label in (("before", "baseline as given"), ("baseline_refitted", "baseline refitted"),
                                       ("after", "with the effect"))]
        self.assertEqual(rows, expected)
        self.assertEqual(errors.count('<tr class="group">'), 2)

    def test_named_effects_are_marked_in_the_ranking(self):
        self.assertEqual(re.findall(r'<tr class="named"><td class="number">1</td><td>(.*?)</td>', self.page_text),
                         ["drainage"])

    def test_shows_every_other_part_of_the_file(self):
        for part in ("Hold the collector for 60 s after the lift", "Known weights on the hook", "136 N",
                     "3.57·10⁻⁶ m/N", "0.600 ± 0.030", "0.580 ± 0.011", "clocks of force and position",
                     "Record both on one computer.", "thickness of the rim as in the default rig",
                     "config/identify/thresholds.yaml", "75 needed, 31 made now", "brash_ice_rig 1.2.3",
                     "records/case_1234_holdout.csv"):
            self.assertIn(part, self.page.text)


class Verdicts(TemporaryReport):
    def test_an_effect_is_named_in_plain_words_with_its_certainty(self):
        report = made_report()
        box = self.box(report)
        self.assertIn("Missing in the simulation: water that drains out of the lifted ice.", box)
        self.assertIn("the log Bayes factor is 87.4, the threshold 7.1", box)
        self.assertIn("Odds about 160,000 to one that the unseen record comes about with the effect", box)
        self.assertIn("Next comes blocks that fall off the collector", box)
        self.assertIn("0.270, with 95 % probability between 0.210 and 0.330", box)
        self.assertIn("Behind the thresholds stand 60 records without an effect", box)
        for error in (report["before"], report["baseline_refitted"], report["after"],
                      report["holdout"]["baseline_refitted"], report["holdout"]["after"]):
            self.assertIn(f"{error['rmse_n']:.0f} N", box)
        self.assertIn("Hold the collector for 60 s", box)

    def test_a_rival_is_none_of_those_that_share_an_effect_with_the_named(self):
        box = self.box(made_report(effects=["drainage", "vessel_heave"]))
        self.assertIn("water that drains out of the lifted ice and heave of the vessel under the crane", box)
        self.assertIn("Next comes blocks that fall off the collector", box)

    def test_what_has_more_evidence_than_the_named_one_is_told_with_the_reason(self):
        report = made_report()
        stronger = report["ranking"][1]
        title = identify_report.effect_title(stronger["effects"][0])
        stronger.update(log_bayes_factor=99.0, holdout_log_ratio=-3.1)
        box = self.box(report)
        self.assertIn(f"The evidence of this record for {title} is stronger (log Bayes factor 99.0), but it is not named: "
                      "the record that the fit has not seen is less probable with it than without (log odds −3.1).", box)
        self.assertNotIn(f"Next comes {title}", box)
        self.assertIn("Next comes", box)
        stronger.update(holdout_log_ratio=1.0, evidence_of_both=100.0, detectability=4.2, explained_ratio=0.3,
                        confirmed=True)
        self.assertIn("but it is not named: d′ is 4.2, it explains 30 % of what is left unexplained.", self.box(report))
        stronger.update(threshold=6.0, holdout_log_ratio=-0.5, evidence_of_both=98.5)
        together = report["ranking"][0]["evidence_of_both"]
        self.assertIn("but it is not named: of both records together there is less for it "
                      f"(log Bayes factor 98.5 against {together:.1f}).", self.box(report))
        stronger.update(threshold=25.0, evidence_of_both=79.5)
        self.assertIn("but it is not named: of both records together, less what lifts without an effect have of it, there "
                      f"is less for it (log Bayes factor 79.5 against {together:.1f}).", self.box(report))
        stronger["holdout_way_log_ratio"] = 5.6
        self.assertIn("but it is not named: the unseen record, at another speed, is more probable if its waves keep their "
                      "length along the hoist's way (log odds 5.6, against −0.5 if they keep their period)",
                      self.box(report))
        stronger.update(holdout_way_log_ratio=None, holdout_log_ratio=None, threshold=6.0, evidence_of_both=99.0)
        report["ranking"][0]["evidence_of_both"] = 87.4
        self.assertIn("but it is not named: d′ is 4.2, it explains 30 % of what is left unexplained.", self.box(report))
        stronger["error_ratio"] = 5.8
        self.assertIn("but it is not named: with it the curve is 5.8 times as far from this record as without",
                      self.box(report))
        stronger["error_ratio"] = 1.9
        stronger["holdout_ratio"] = 2.1
        self.assertIn("but it is not named: with it the curve is 2.1 times as far from the unseen record as without",
                      self.box(report))
        stronger["holdout_ratio"] = 0.9
        stronger["explained_ratio"] = None
        self.assertIn("but it is not named: d′ is 4.2.", self.box(report))
        stronger["confirmed"] = False
        self.assertIn("but it is not named: it was not simulated in full.", self.box(report))

    def test_tie_with_a_small_residual_does_not_call_it_large(self):
        report = made_report("tie")
        report["significance"]["significant"] = True
        self.assertIn("The residual is no accident", self.box(report))
        report["significance"]["significant"] = False
        self.assertIn("The residual is small, and these make the record more probable all the same", self.box(report))

    def test_unknown_by_evidence_alone_says_what_the_held_out_record_has_against_it(self):
        report = made_report("unknown")
        title = identify_report.effect_title(report["ranking"][0]["effects"][0])
        self.assertIn("The residual is no accident", self.box(report))
        report["significance"]["significant"] = False
        report["ranking"][0].update(log_bayes_factor=29.7, holdout_log_ratio=-2.4, confirmed=True)
        box = self.box(report)
        self.assertIn("The residual is small", box)
        self.assertIn(f"more probable with {title} than without (log Bayes factor 29.7), which is not named: the record "
                      "that the fit has not seen is less probable with it than without (log odds −2.4).", box)

    def test_a_tie_names_all_rivals_and_no_winner(self):
        box = self.box(made_report("tie"))
        self.assertIn("cannot tell which of these it is: a load cell whose calibration factor is off or a load cell "
                      "whose zero is off", box)
        self.assertIn("load_cell_scale 30.0; load_cell_bias 29.0", box)

    def test_other_verdicts_say_so(self):
        for verdict, words in (("unknown", "none of the effects that the program knows"),
                               ("none", "Nothing is missing that this record could show"),
                               ("cannot_tell", "cannot tell whether anything is missing")):
            with self.subTest(verdict):
                box = self.box(made_report(verdict))
                self.assertIn(words, box)
                self.assertNotIn("Missing in the simulation:", box)

    def test_thresholds_without_null_runs_are_called_textbook(self):
        for runs in (0, None):
            thresholds = {"log_bayes_factor": 6.0, "null_records": runs, "file": "built in"}
            self.assertIn("No record without an effect stands behind the thresholds",
                          self.box(made_report(thresholds=thresholds)))

    def test_a_larger_error_on_the_unseen_record_is_said(self):
        report = made_report()
        report["holdout"]["after"]["rmse_n"] = 1.1 * report["holdout"]["baseline_refitted"]["rmse_n"]
        self.assertIn("Its error is larger with the effect, all the same", self.box(report))
        report["holdout"]["after"]["rmse_n"] = 0.9 * report["holdout"]["baseline_refitted"]["rmse_n"]
        self.assertNotIn("Its error is larger", self.box(report))

    def test_without_held_out_record_the_page_says_what_that_means(self):
        page = self.page(made_report(holdout=False))
        self.assertIn("No held-out record was given", page)
        self.assertEqual(page.count("<svg"), 5)

    def test_odds_are_those_of_the_logarithm(self):
        self.assertEqual(identify_report.odds(np.log(20.0)), "about 20 to one")
        self.assertEqual(identify_report.odds(np.log(34567.0)), "about 35,000 to one")
        self.assertEqual(identify_report.odds(20.0), "more than a million to one")
        self.assertEqual(identify_report.odds(0.0), "about even")

    def test_synthetic_records_are_marked_and_field_records_are_not(self):
        page = self.page(made_report())
        self.assertLess(page.index("SYNTHETIC RECORD"), page.index("<h1>"))
        field = made_report(source="field")
        self.assertEqual(identify_report.synthetic_banner(field), "")
        field["holdout_record"]["source"] = "synthetic"
        self.assertIn("SYNTHETIC RECORD (held out)", identify_report.synthetic_banner(field))

    def test_every_effect_of_the_library_has_a_title(self):
        with open(os.path.join(SOURCE_DIR, "doc", "effects.md"), encoding="utf-8") as stream:
            names = re.findall(r"(?m)^## ([a-z_]+)$", stream.read())
        self.assertEqual(set(identify_data.EFFECT_TITLES), set(names))
        self.assertEqual(identify_data.effect_title("of_my_own"), "of_my_own")


class Input(TemporaryReport):
    def run_script(self, hash_seed="0"):
        return subprocess.run([sys.executable, "-B", SCRIPT, self.directory], capture_output=True, text=True,
                              check=False, env={**os.environ, "PYTHONHASHSEED": hash_seed})

    def test_same_report_same_bytes(self):
        write_made_report(self.directory, made_report())
        pages = []
        for hash_seed in ("1", "2"):
            done = self.run_script(hash_seed)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            with open(os.path.join(self.directory, "report.html"), "rb") as stream:
                pages.append(stream.read())
        self.assertEqual(*pages)

    def refusal(self, report):
        write_made_report(self.directory, report)
        with self.assertRaises(identify_data.BadInput) as raised:
            identify_data.read_report(self.directory)
        return str(raised.exception)

    def test_every_key_that_is_missing_is_named(self):
        """Takes out each key of the file, one at a time."""
        def without(value, path):
            if isinstance(value, dict):
                for key in value:
                    if path and path[0] in ("thresholds", "discrepancy"):
                        continue  # their keys are the program's own
                    yield [*path, key]
                    yield from without(value[key], [*path, key])
            elif isinstance(value, list) and value and isinstance(value[0], dict):
                yield from without(value[0], [*path, 0])

        whole = made_report()
        paths = list(without(whole, []))
        self.assertGreater(len(paths), 150)
        for path in paths:
            report = json.loads(json.dumps(whole))
            place = report
            for part in path[:-1]:
                place = place[part]
            del place[path[-1]]
            name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)[1:]
            with self.subTest(name), self.assertRaises(identify_data.BadInput) as raised:
                identify_data.REPORT(report, "")
            self.assertEqual(str(raised.exception), f"{name} is missing")

    def test_wrong_values_are_named_with_their_rule(self):
        def changed(change):
            report = made_report()
            change(report)
            return report

        for message, change in (
                ('verdict = "maybe", must be one of', lambda r: r.update(verdict="maybe")),
                ("kappa = true, must be a number or null", lambda r: r.update(kappa=True)),
                ('ranking[1].log_bayes_factor = "9"', lambda r: r["ranking"][1].update(log_bayes_factor="9")),
                ("summary[0] = 3, must be a text", lambda r: r.update(summary=[3])),
                ("series must hold arrays of one length", lambda r: r["series"]["way_m"].pop()),
                ("effects must not be empty with verdict effect", lambda r: r.update(effects=[])),
                ("record must be an object", lambda r: r.update(record=[])),
                ("thresholds.x = [1], must be a number, a text or null", lambda r: r["thresholds"].update(x=[1])),
                ("next_experiment = {}, must be a list", lambda r: r.update(next_experiment={}))):
            with self.subTest(message):
                refusal = self.refusal(changed(change))
                self.assertIn(message, refusal)
                self.assertIn("report.json", refusal)

    def test_a_program_that_finds_a_bad_file_ends_with_2(self):
        done = self.run_script()
        self.assertEqual(done.returncode, 2)
        self.assertIn("No such file", done.stderr)
        path = os.path.join(self.directory, "report.json")
        for content, message in (("{", "report.json: "), ("[]", "must be an object"), ('{"kappa": NaN}', "NaN is no"),
                                 ("{}", "program is missing")):
            with open(path, "w", encoding="utf-8") as stream:
                stream.write(content)
            done = self.run_script()
            with self.subTest(content):
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertTrue(done.stderr.startswith("identify_report: "), done.stderr)
                self.assertIn(message, done.stderr)

    def test_numbers_that_are_not_finite_become_dashes(self):
        report = made_report()
        report["kappa"] = report["before"]["rmse_n"] = report["ranking"][0]["detectability"] = None
        report["ranking"][3]["log_bayes_factor"] = report["ranking"][2]["threshold"] = None
        report["series"]["with_effect_n"][5] = report["baseline"][0]["sigma"] = None
        report["minimum_detectable"][1]["value"] = report["significance"]["threshold_chi2_per_bin"] = None
        page = self.page(report)
        self.assertNotRegex(PageReader(page).text, r"\bnan\b")
        self.assertIn("RMSE – N with the model as given", page)

    def test_texts_of_the_file_are_not_markup(self):
        bad = "<b>bold</b>"
        report = made_report(summary=[bad], program=bad, effects=[bad], next_experiment=[
            {"text": bad, "separates": [bad]}], confusable=[{"names": [bad], "correlation": 0.9, "how_to_tell": bad}])
        report["record"].update(title=bad, path=bad, assumptions=[bad])
        report["ranking"][0].update(note=bad, effects=[bad])
        page = self.page(report)
        self.assertNotIn("<b>", page)
        self.assertIn("&lt;b&gt;bold&lt;/b&gt;", page)

    def test_a_record_that_gave_nothing_to_compare_still_has_a_page(self):
        empty = {key: [] for key in made_report()["series"]}
        page = self.page(made_report(
            "cannot_tell", ranking=[], baseline=[], minimum_detectable=[], confusable=[], next_experiment=[],
            series=empty, holdout_series=None, autocorrelation={"lag_s": [], "before": [], "after": None, "band": None}))
        self.assertIn("No effect was tried", page)
        self.assertEqual(page.count("<svg"), 0)


class Figures(unittest.TestCase):
    def test_intervals_of_the_baseline_are_95_percent_of_a_normal_distribution(self):
        # 1.96 standard deviations on each side (any table of the normal distribution).
        report = {"baseline": [{"key": "k", "unit": "Pa", "prior": 10.0, "prior_sigma": 2.0, "fitted": 11.0,
                                "sigma": 1.0}]}
        (label, *values), = identify_figures.interval_rows(report, [])
        self.assertEqual(label, "k (Pa)")
        np.testing.assert_allclose(values, [6.08, 13.92, 9.04, 11.0, 12.96])

    def test_named_entries_are_the_best_of_an_effect_and_all_of_a_tie(self):
        with tempfile.TemporaryDirectory() as directory:
            write_made_report(directory, made_report())
            self.assertEqual([entry["effects"] for entry in identify_data.named_entries(
                identify_data.read_report(directory))], [["drainage"]])
            write_made_report(directory, made_report("tie"))
            self.assertEqual([entry["effects"] for entry in identify_data.named_entries(
                identify_data.read_report(directory))], [[name] for name in TIES["tie"]])


if __name__ == "__main__":
    unittest.main()
