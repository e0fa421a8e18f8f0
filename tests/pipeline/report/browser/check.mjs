// check.mjs PAGE FOLDER [pictures]: opens a report in Chromium as its readers do and writes FOLDER/findings.json and the
// printed page, and screenshots of the whole page where asked. The test reads the findings; a fault of the browser itself
// ends with status 1.
import { chromium } from "playwright-core";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [page_file, folder, pictures] = process.argv.slice(2);
const address = pathToFileURL(page_file).href;
const axe = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
mkdirSync(folder, { recursive: true });

const findings = { complaints: [], requests: [], accessibility: {}, layout: {} };
const browser = await chromium.launch({ executablePath: "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });

async function open(options) {
  // axe is put into the page by the test, which the page's own security policy would refuse.
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, bypassCSP: options.axe ?? false, ...options.context });
  context.setDefaultTimeout(600000);  // a busy machine is slow, which is no fault of the page
  const page = await context.newPage();
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) findings.complaints.push(message.text().slice(0, 400)); });
  page.on("pageerror", (error) => findings.complaints.push(String(error).slice(0, 400)));
  page.on("request", (request) => {
    if (!/^(file|data|blob):/.test(request.url())) findings.requests.push(request.url().slice(0, 200));
  });
  await page.goto(address, { waitUntil: "load" });
  return page;
}

async function photograph(page, name) {
  if (pictures) await page.screenshot({ path: `${folder}/${name}.png`, fullPage: true });
}

/// Elements that stick out of the window to the right, but for those that scroll on their own.
const sticking_out = () => [...document.querySelectorAll("body *")].filter((element) => {
  const box = element.getBoundingClientRect();
  return box.width > 0 && box.right > document.documentElement.clientWidth + 1 && !element.closest(".scroll, pre, .skip, nav ul");
}).map((element) => `${element.tagName}.${element.className?.baseVal ?? element.className} ${element.textContent.slice(0, 40)}`).slice(0, 5);

const luminance = () => {
  const [r, g, b] = getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number);
  return (0.2126 * r + 0.7152 * g + 0.0722 * b) / 255;
};

async function violations(page) {
  await page.addScriptTag({ path: axe });
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.filter((violation) => ["serious", "critical"].includes(violation.impact))
    .map((violation) => `${violation.id}: ${violation.help}: ${violation.nodes.slice(0, 3).map((node) => node.target).join("; ")}`);
}

// 1. As it opens: the viewer starts, answers to mouse and keyboard, and so does the slider.
{
  const page = await open({});
  findings.viewer = await page.locator(".viewer").count() > 0;
  if (findings.viewer) {
    await page.locator(".viewer").scrollIntoViewIfNeeded();
    await page.waitForSelector(".viewer[data-ready=true]", { state: "attached" });
    const canvas = page.locator("#viewer-canvas");
    await canvas.scrollIntoViewIfNeeded();
    const picture = async () => { await page.waitForTimeout(250); return (await canvas.screenshot()).toString("base64"); };
    const first = await picture();
    findings.viewer_is_still = first === await picture();
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width * 0.35, box.y + box.height / 4);
    await page.mouse.wheel(0, 240);
    const scrolled = await picture();
    findings.viewer_scrolls = scrolled !== first;
    await canvas.focus();
    await page.keyboard.press("ArrowUp");
    await page.keyboard.press("ArrowUp");
    const stepped = await picture();
    findings.viewer_obeys_keys = stepped !== scrolled;
    await page.selectOption("#viewer-layout", { label: "3-D only" });
    const solid = await picture();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 30, { steps: 4 });
    await page.mouse.up();
    findings.viewer_turns = await picture() !== solid;
    await page.selectOption("#viewer-layout", { index: 0 });
    // Without room (hidden, or a window that is being drawn narrow) it complains of nothing.
    for (const style of ["width: 0", "width: 12px"]) {
      await canvas.evaluate((element, text) => {
        element.style.cssText = text;
        window.dispatchEvent(new Event("resize"));
      }, style);
      await page.waitForTimeout(250);
    }
    await canvas.evaluate((element) => { element.style.cssText = ""; window.dispatchEvent(new Event("resize")); });
  }
  const slider = page.locator(".compare input[type=range]").first();
  findings.slider = await slider.count() > 0;
  if (findings.slider) {
    await slider.scrollIntoViewIfNeeded();
    const figure = page.locator(".compare .slider").first();
    const before = (await figure.screenshot()).toString("base64");
    await slider.focus();
    for (let i = 0; i < 30; ++i) await page.keyboard.press("ArrowLeft");
    findings.slider_moves = (await figure.screenshot()).toString("base64") !== before && await slider.inputValue() === "20";
  }
  // Neurological convention: the slices turn over, their letters do not, and the patient's left is on the left.
  const side = () => page.evaluate(() => {
    const shown = [...document.querySelectorAll("#slice-od-axial text")].filter((text) => getComputedStyle(text).display !== "none");
    return { left: shown.sort((a, b) => a.getBoundingClientRect().x - b.getBoundingClientRect().x)[0].textContent,
      flipped: getComputedStyle(document.querySelector("#slice-od-axial .anatomy")).transform };
  });
  findings.radiological = await side();
  await page.locator(".convention input").check();
  findings.neurological = await side();
  await page.locator(".convention input").uncheck();
  const contours = () => page.locator("#slice-od-axial .contour").first().isVisible();
  const shown = await contours();
  await page.locator(".contours input").uncheck();
  findings.contours_hide = shown && !(await contours());
  await page.locator(".contours input").check();
  findings.layout.desktop = await page.evaluate(sticking_out);
  findings.panels_a_line = {};
  for (const width of [700, 1000, 1200, 1600]) {
    await page.setViewportSize({ width, height: 900 });
    findings.panels_a_line[width] = await page.evaluate(() => [...document.querySelectorAll(".figures")]
      .filter((row) => row.children.length === 4 && row.checkVisibility())
      .map((row) => getComputedStyle(row).gridTemplateColumns.split(" ").length));
  }
  await page.setViewportSize({ width: 1280, height: 900 });
  findings.light = await page.evaluate(luminance);
  await page.evaluate(() => scrollTo(0, 0));
  await photograph(page, "desktop");

  // 2. On paper: the canvas of WebGL would print as a black box.
  await page.emulateMedia({ media: "print" });
  findings.canvas_printed = await page.locator("canvas:visible").count() > 0;
  await page.emulateMedia({ media: null });
  writeFileSync(`${folder}/printed.pdf`, await page.pdf({ preferCSSPageSize: true, printBackground: true }));
  await page.setViewportSize({ width: 375, height: 812 });
  findings.layout.narrow = await page.evaluate(sticking_out);
  await photograph(page, "narrow");
  await page.context().close();
}
const dots_per_inch = 36;
execFileSync("pdftoppm", ["-gray", "-r", String(dots_per_inch), `${folder}/printed.pdf`, `${folder}/printed`]);
findings.printed = { text: execFileSync("pdftotext", ["-layout", `${folder}/printed.pdf`, "-"]).toString(), widest_black: 0 };
const pages = execFileSync("pdfinfo", [`${folder}/printed.pdf`]).toString().match(/Pages:\s+(\d+)/)[1];
for (let number = 1; number <= Number(pages); ++number) {
  const raw = readFileSync(`${folder}/printed-${String(number).padStart(pages.length, "0")}.pgm`);
  const [width, height] = raw.toString("latin1", 0, 20).split(/\s+/).slice(1, 3).map(Number);
  const pixels = raw.subarray(raw.length - width * height);
  for (let row = 0; row < height; ++row)
    for (let column = 0, run = 0; column < width; ++column) {
      run = pixels[row * width + column] < 24 ? run + 1 : 0;
      findings.printed.widest_black = Math.max(findings.printed.widest_black, run / width);
    }
}
findings.printed.pages = Number(pages);

// 3. Both colour schemes, to a reader who needs contrast, names and order.
for (const [scheme, width] of [["light", 1280], ["dark", 1280], ["light", 375], ["dark", 375]]) {
  const page = await open({ axe: true, context: { colorScheme: scheme, reducedMotion: "reduce", viewport: { width, height: 812 } } });
  findings.accessibility[`${scheme} ${width}`] = await violations(page);
  if (scheme === "dark" && width > 1000) {
    findings.dark = await page.evaluate(luminance);
    await photograph(page, "dark");
  }
  await page.context().close();
}

// 4. Without JavaScript everything is still there to read.
{
  const page = await open({ context: { javaScriptEnabled: false } });
  findings.without_scripts = {
    text: await page.locator("main").innerText(),
    pictures: await page.locator(".compare .pair img").count(),
    pictures_shown: await page.locator(".compare .pair img:visible").count(),
    figures: await page.locator(".picture svg:visible").count() };
  await page.context().close();
}
await browser.close();
writeFileSync(`${folder}/findings.json`, JSON.stringify(findings, null, 1));
