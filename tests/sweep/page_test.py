#!/usr/bin/env python3
"""The page of a sweep in headless Chromium, at the width of a phone and of a desk. Exits 77 where there is no browser.

    page_test.py --bin BUILD/bin [--screenshots FOLDER]
"""
import argparse
import base64
import csv
import io
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

OPTIONS = argparse.Namespace(bin=None, screenshots=None)
HOSTILE = "</script><script>document.title = 1</script><b>&amp; @DATA@"
SPEC = {"title": HOSTILE, "inputs": ["menger:2", {"name": "a 'sphere' & more", "input": "sphere:20"}],
        "codecs": [{"tool": "svmm-encode", "name": "svmm", "options": {"quality": [50, 85, 100], "blockwidth": ["2", "x"], "rootwidth": 2}},
                   {"tool": "vq-encode", "name": "vq", "inputs": ["a 'sphere' & more"], "options": {"reduce": [2, 8]}}],
        "renders": [{"name": "view", "options": {"size": "200x150"}}],
        "plots": [{"name": "levels", "title": "Levels and size", "x": "levels", "y": "percent", "log": "y"},
                  {"name": "joined", "title": "Joined", "x": "quality", "y": "psnr", "line": "all", "baseline": "view.ms_avg"},
                  {"name": "one-codec", "title": "One codec", "x": "percent", "y": "rmse", "codecs": ["vq"]}]}
WIDTHS = {390: 844, 1280: 900}


def lacking():
    try:
        import selenium.webdriver  # noqa: F401
    except ImportError:
        return "python3-selenium"
    if shutil.which("chromedriver") is None:
        return "chromium-driver"
    if not (OPTIONS.bin.parent / "lib" / "voxkit" / "image_stack.so").exists():
        return "the module image_stack of this build"
    page = OPTIONS.bin.parent / "share" / "voxkit" / "sweep" / "chart.min.js"
    if not page.exists() and not pathlib.Path("/usr/share/javascript/chart.js/chart.min.js").exists():
        return "libjs-chart.js"
    return None


def browser(width):
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
                     f"--window-size={width},{WIDTHS[width]}"):
        options.add_argument(argument)
    if width < 500:
        metrics = {"width": width, "height": WIDTHS[width], "pixelRatio": 2.0}
        options.add_experimental_option("mobileEmulation", {"deviceMetrics": metrics})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


class PageTest(unittest.TestCase):
    width = 1280

    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory(prefix="voxkit-page-")
        cls.addClassCleanup(temporary.cleanup)
        folder = pathlib.Path(temporary.name)
        (folder / "spec.json").write_text(json.dumps(SPEC), encoding="utf-8")
        done = subprocess.run([str(OPTIONS.bin / "vox-sweep"), str(folder / "spec.json"), "-o", str(folder / "out"), "--quiet"],
                              capture_output=True, text=True, timeout=300, check=False)
        if done.returncode != 1:  # blocks of width x cannot be
            raise AssertionError(done.stderr)
        # Alone: that nothing else is needed is part of the test.
        cls.page = folder / "alone.html"
        shutil.copy(folder / "out" / "index.html", cls.page)
        cls.table = list(csv.DictReader(io.StringIO((folder / "out" / "results.csv").read_text(encoding="utf-8"))))
        shutil.rmtree(folder / "out")
        cls.driver = browser(cls.width)
        cls.addClassCleanup(cls.driver.quit)

    def setUp(self):
        self.driver.get(self.page.as_uri())
        self.addCleanup(self.check_log)

    def check_log(self):
        self.assertEqual(self.driver.get_log("browser"), [])

    def script(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def find(self, selector):
        from selenium.webdriver.common.by import By
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def keys(self, element, *names):
        from selenium.webdriver.common.keys import Keys
        element.send_keys(*[getattr(Keys, name, name) for name in names])

    def settings(self):
        return self.script("return [...document.querySelectorAll('#body th button')].map(b => b.textContent.replace(' ◆', ''))")

    def choose_input(self, name):
        self.script("const s = document.getElementById('input'); s.value = arguments[0]; s.dispatchEvent(new Event('change'));", name)

    def shot(self, name):
        if OPTIONS.screenshots:
            OPTIONS.screenshots.mkdir(parents=True, exist_ok=True)
            height = self.script("return document.documentElement.scrollHeight")
            clip = {"x": 0, "y": 0, "width": self.width, "height": height, "scale": 1}
            data = self.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})["data"]
            (OPTIONS.screenshots / f"{name}-{self.width}.png").write_bytes(base64.b64decode(data))

    def test_fits_and_is_whole(self):
        self.shot("page")
        self.assertLessEqual(self.script("return document.documentElement.scrollWidth"), self.width)
        self.assertEqual(self.find("h1")[0].text, HOSTILE)
        self.assertEqual(self.driver.title, HOSTILE)
        self.assertEqual(self.script("return performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length"), 0)
        self.assertEqual(len(self.find("canvas")), 5)
        self.assertIn(f"{sum(row['status'] == 'failed' for row in self.table)} failed", self.find("#summary")[0].text)
        for canvas in self.find("canvas"):
            box = canvas.rect
            self.assertGreater(min(box["width"], box["height"]), 250)
            self.assertGreater(self.script("const c = arguments[0], d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; "
                                           "let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n", canvas), 2000)

    def test_points_are_those_of_the_table(self):
        for name in ("menger:2", "a 'sphere' & more"):
            self.choose_input(name)
            points = self.script("return charts[0].list.map(p => [p.x, p.row.psnr_db])")
            expected = [[float(row["bits_per_voxel"]), row["psnr_db"]] for row in self.table if row["input"] == name and row["psnr_db"]]
            self.assertEqual(sorted(x for x, _ in points), sorted(x for x, _ in expected))
            self.assertEqual(sorted(str(y) for _, y in points), sorted(str(float(y)) if y != "inf" else y for _, y in expected))

    def test_sort(self):
        self.choose_input("a 'sphere' & more")

        def column(index):
            return self.script("return [...document.querySelectorAll('#body tr')].map(r => r.cells[arguments[0]].textContent)", index)

        heads = self.script("return [...document.querySelectorAll('#head th')].map(h => h.dataset.column)")
        index = heads.index("percent")
        for descending in (False, True):
            self.script("document.querySelectorAll('#head button')[arguments[0]].click()", index)
            numbers = [float(text) for text in column(index) if text]
            self.assertEqual(len(numbers), 5)
            self.assertEqual(numbers, sorted(numbers, reverse=descending))
            cell = self.find("#head th")[index]
            self.assertEqual(cell.get_attribute("aria-sort"), "descending" if descending else "ascending")
            self.assertTrue(self.script("return arguments[0].contains(document.activeElement)", cell))
        psnr = heads.index("psnr_db")  # the best first; infinity is the greatest
        self.keys(self.find("#head button")[psnr], "ENTER")
        self.assertEqual(column(psnr)[0], "∞")

    def test_filter(self):
        self.choose_input("")
        self.assertEqual(len(self.settings()), len(self.table))
        box = self.find("#conditions")[0]
        median = sorted(int(row["file_bytes"]) for row in self.table if row["file_bytes"])[4]
        box.send_keys(f"psnr >= 20, file_bytes <= {median}")
        expected = [row for row in self.table if row["psnr_db"] and float(row["psnr_db"]) >= 20 and int(row["file_bytes"]) <= median]
        self.assertTrue(0 < len(expected) < 8)
        self.assertEqual(len(self.settings()), len(expected))
        self.assertEqual(self.script("return charts[0].list.length"), len(expected))
        box.clear()
        box.send_keys("vq")  # words, too
        self.assertEqual(len(self.settings()), 2)
        box.clear()
        box.send_keys("nothing > 3")
        self.assertIn("nothing", self.find("#condition-error")[0].text)
        self.assertEqual(box.get_attribute("aria-invalid"), "true")
        box.clear()
        self.keys(self.find("#front-only")[0], "SPACE")
        self.assertEqual(len(self.settings()), sum(row["pareto"] == "true" for row in self.table))
        self.keys(self.find("#codecs input")[0], "SPACE")
        self.assertEqual(len(self.settings()), sum(row["pareto"] == "true" and row["codec"] == "vq" for row in self.table))

    def test_columns(self):
        self.script("document.getElementById('chooser').open = true")
        before = len(self.find("#head th"))
        boxes = {label.text: label for label in self.find("#columns label")}
        self.script("arguments[0].click()", boxes["raw_bytes"])
        self.assertEqual(len(self.find("#head th")) - before, 1)
        self.script("arguments[0].click()", boxes["reduce"])  # no volume that is shown has it
        self.assertEqual(len(self.find("#head th")) - before, 1)
        self.choose_input("a 'sphere' & more")
        self.assertEqual(len(self.find("#head th")) - before, 2)
        self.assertLessEqual(self.script("return document.documentElement.scrollWidth"), self.width)

    def test_charts_by_keyboard(self):
        canvas = self.find("canvas")[0]
        self.keys(canvas, "ARROW_RIGHT")
        first = self.find("#chart-0 .told")[0].text
        self.assertIn("svmm", first)
        self.assertEqual(self.script("return document.querySelectorAll('[aria-current=true]').length"), 1)
        self.keys(canvas, "ARROW_RIGHT")
        self.assertNotEqual(self.find("#chart-0 .told")[0].text, first)
        self.keys(canvas, "ARROW_LEFT")
        self.assertEqual(self.find("#chart-0 .told")[0].text, first)
        self.keys(canvas, "ENTER")
        self.assertEqual(self.script("return document.activeElement.id"), "split")

    def test_chart_by_pointer(self):
        from selenium.webdriver.common.action_chains import ActionChains
        canvas = self.find("canvas")[0]
        self.script("arguments[0].scrollIntoView({block: 'center'})", canvas)
        x, y = self.script("const m = charts[0].chart.getDatasetMeta(charts[0].chart.data.datasets.length - 1).data[0]; return [m.x, m.y]")
        box = canvas.rect
        ActionChains(self.driver).move_to_element_with_offset(canvas, round(x - box["width"] / 2), round(y - box["height"] / 2)).click().perform()
        chosen = "return document.querySelectorAll('[aria-current=true]').length"
        deadline = time.monotonic() + 5  # a tap becomes a click a little later
        while self.script(chosen) == 0 and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertEqual(self.script(chosen), 1)

    def test_axes(self):
        self.script("const s = charts[1].x; s.value = 'file_bytes'; s.dispatchEvent(new Event('change'));")
        self.assertEqual(self.script("return charts[1].chart.scales.x.options.title.text"), "bytes")
        self.keys(self.find("#chart-1 .check input")[0], "SPACE")
        self.assertEqual(self.script("return charts[1].chart.scales.x.type"), "logarithmic")

    def test_joined_points(self):
        """A plot that joins all points has them from left to right, no front, and the median of its baseline."""
        sets = self.script("return charts[3].chart.data.datasets.map(d => [d.label, Boolean(d.showLine), d.data.map(p => [p.x, p.y])])")
        self.assertEqual([name for name, _, _ in sets], ["svmm", "view: ms a frame"])
        self.assertTrue(all(joined for _, joined, _ in sets))
        across = [x for x, _ in sets[0][2]]
        self.assertEqual(across, [50, 85, 100])
        times = sorted(float(row["view.ms_avg"]) for row in self.table if row["input"] == "menger:2" and row["view.ms_avg"])
        self.assertEqual([y for _, y in sets[1][2]], [times[1]] * 2)

    def test_plot_of_one_codec(self):
        self.choose_input("a 'sphere' & more")
        shown = self.script("return charts[4].list.map(p => p.row.codec)")
        self.assertEqual(shown, ["vq", "vq"])

    def test_slider(self):
        for image in self.find("#before, #after"):
            self.assertEqual(self.script("return [arguments[0].complete, arguments[0].naturalWidth]", image), [True, 200])
            self.assertTrue(image.get_attribute("alt"))
        boxes = self.script("return ['before', 'after'].map(i => { const r = document.getElementById(i).getBoundingClientRect(); "
                            "return [r.x, r.y, r.width, r.height]; })")
        self.assertEqual(boxes[0], boxes[1])  # exactly on top of each other
        slider = self.find("#split")[0]
        self.keys(slider, "ARROW_RIGHT", "ARROW_RIGHT")
        self.assertEqual(self.find("#split-value")[0].text, "52 %")
        self.assertIn("52%", self.script("return getComputedStyle(document.getElementById('after')).clipPath"))
        self.keys(slider, "HOME")
        self.assertIn("0%", self.script("return getComputedStyle(document.getElementById('after')).clipPath"))
        before = self.find("#after")[0].get_attribute("src")
        self.keys(self.find("#next")[0], "ENTER")
        self.assertNotEqual((self.find("#after")[0].get_attribute("src"), self.find("#picture-setting")[0].text), (before, ""))
        self.keys(self.find("#difference")[0], "SPACE")
        self.assertEqual(self.script("return getComputedStyle(document.getElementById('after')).mixBlendMode"), "difference")
        self.shot("difference")

    def test_slider_by_pointer(self):
        from selenium.webdriver.common.action_chains import ActionChains
        stage = self.find("#stage")[0]
        self.script("arguments[0].scrollIntoView({block: 'center'})", stage)
        width = stage.rect["width"]
        ActionChains(self.driver).move_to_element(stage).click_and_hold().move_by_offset(round(width * 0.25), 0).release().perform()
        value = int(self.find("#split")[0].get_attribute("value"))
        self.assertAlmostEqual(value, 75, delta=2)

    def test_row_shows_its_picture(self):
        self.choose_input("a 'sphere' & more")
        row = next(button for button in self.find("#body th button") if "vq" in button.text)
        self.script("arguments[0].click()", row)
        self.assertIn("vq reduce", self.find("#picture-setting")[0].text)
        self.assertIn("vq reduce", self.find("#chart-0 .told")[0].text)

    def test_names_for_those_who_do_not_see(self):
        nameless = self.script("""
            return [...document.querySelectorAll('button, input, select, canvas, img, [tabindex]')].filter(e =>
              !(e.labels && e.labels.length && e.labels[0].textContent.trim()) && !e.getAttribute('aria-label') &&
              !e.getAttribute('aria-labelledby') && !e.textContent.trim() && !e.alt).map(e => e.outerHTML)""")
        self.assertEqual(nameless, [])
        self.assertEqual(self.script("const i = [...document.querySelectorAll('[id]')].map(e => e.id); return i.length - new Set(i).size"), 0)
        self.assertEqual(self.script("return document.documentElement.lang"), "en")

    def test_contrast(self):
        """Text against what is behind it: 4.5 to 1 or more, as WCAG asks."""
        worst = self.script("""
            const lum = c => { const v = c.match(/[\\d.]+/g).slice(0, 3).map(x => { x /= 255; return x <= .03928 ? x / 12.92 : ((x + .055) / 1.055) ** 2.4; });
              return .2126 * v[0] + .7152 * v[1] + .0722 * v[2]; };
            const ground = e => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor; if (!/, 0\\)$/.test(c)) return c; } return 'rgb(255,255,255)'; };
            return Math.min(...[...document.querySelectorAll('p, label, th button, td, h1, h2, legend, summary, .tag')].filter(e => e.textContent.trim()).map(e => {
              const [a, b] = [lum(getComputedStyle(e).color), lum(ground(e))].sort((x, y) => y - x); return (a + .05) / (b + .05); }));""")
        self.assertGreaterEqual(worst, 4.5)


class PhoneTest(PageTest):
    width = 390

    def test_fingers(self):
        """What is touched is large enough: 24 pixels a side, as WCAG asks."""
        small = self.script("""
            return [...document.querySelectorAll('button, select, label.check, input[type=range], input[type=search], summary')]
              .filter(e => e.offsetParent && (e.getBoundingClientRect().height < 24 || e.getBoundingClientRect().width < 24)).map(e => e.outerHTML)""")
        self.assertEqual(small, [])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--screenshots", type=pathlib.Path)
    OPTIONS, rest = parser.parse_known_args()
    OPTIONS.bin = OPTIONS.bin.resolve()
    if lacking():
        print(f"skipped: expected {lacking()}")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1] + rest)
