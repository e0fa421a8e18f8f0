// living.mjs PAGE SETTINGS.json FOLDER [brief|pictures]: opens a page whose eyes look out of it, as its readers do. SETTINGS is
// a list of { name, set, width, samples }; each picture is written as FOLDER/NAME.rgba, all else to FOLDER/findings.json; brief leaves
// out what is the same for every eye, pictures adds screenshots. EMMETROPE_FULL_PICTURES: how soon and how fast it draws, too.
import { chromium } from "playwright-core";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [page_file, settings_file, folder, extent] = process.argv.slice(2);
const pictures = extent === "pictures", brief = extent === "brief", timed = process.env.EMMETROPE_FULL_PICTURES !== undefined;
const address = pathToFileURL(page_file).href;
const axe = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
mkdirSync(folder, { recursive: true });
const findings = { complaints: [], requests: [], accessibility: {}, layout: {} };
const browser = await chromium.launch({ executablePath: "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });

async function open({ hash = "", before, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, ...options });
  context.setDefaultTimeout(600000);  // a busy machine is slow, which is no fault of the page
  const page = await context.newPage();
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) findings.complaints.push(message.text().slice(0, 400)); });
  page.on("pageerror", (error) => findings.complaints.push(String(error).slice(0, 400)));
  page.on("request", (request) => { if (!/^(file|data|blob):/.test(request.url())) findings.requests.push(request.url().slice(0, 200)); });
  if (before) await page.addInitScript(before);
  await page.goto(address + hash, { waitUntil: "load" });
  return page;
}
const at_rest = (page) => page.waitForFunction(() => String(window.emmetrope.work) === document.querySelector(".living").dataset.ready);
const settled = async (page) => { await page.waitForTimeout(300); await at_rest(page); };

// 1. As it opens: how soon, and how fast.
if (timed) {
  const page = await open({ before: () => { window.opened = performance.now(); } });
  await page.waitForFunction(() => window.emmetrope?.stats().rays_per_s > 0);
  findings.first_picture_ms = await page.evaluate(() => performance.now() - window.opened);
  await settled(page);
  findings.speed = await page.evaluate(async () => {
    const steps = 20, living = window.emmetrope;
    const drag = async (set) => {
      let done = 0;
      living.set(set(0));
      await new Promise((resolve) => setTimeout(resolve, 600));
      const begun = performance.now();
      for (; done < steps; ++done) {
        living.set(set(done));
        await living.quick(living.work);
      }
      return { frames_per_s: 1e3 * steps / (performance.now() - begun), ...living.stats() };
    };
    const result = { lens: await drag((k) => ({ sphere_D: -1 + 0.1 * k, cylinder_D: -0.5 })), gaze: await drag((k) => ({ gaze_deg: [0.1 * k, 0] })),
      accommodation: await drag((k) => ({ accommodation_D: 0.1 * k })), pupil: await drag((k) => ({ pupil_mm: 3 + 0.1 * k })) };
    living.set({ ...living.opening });
    await living.image();
    result.rest_ms = living.stats().rest_ms;
    return result;
  });
  await page.context().close();
}

// 2. Its pictures, for who traces the same ones.
{
  const page = await open();
  for (const { name, set, width, samples } of JSON.parse(readFileSync(settings_file, "utf8"))) {
    const pixels = await page.evaluate(async ([change, side, rays]) => {
      const living = window.emmetrope;
      living.set({ ...living.opening, ...change, samples: rays });
      const { data } = await living.image({ width: side });
      let text = "";
      for (let i = 0; i < data.length; i += 8192) text += String.fromCharCode(...data.subarray(i, i + 8192));
      return btoa(text);
    }, [set, width, samples]);
    writeFileSync(`${folder}/${name}.rgba`, Buffer.from(pixels, "base64"));
  }
  findings.sharpest = await page.evaluate(() => Object.fromEntries(window.emmetrope.eyes.map((eye) => {
    const value = (power) => window.emmetrope.quality(eye.id, { ...window.emmetrope.opening, ...fromPower(power), distance_mm: Infinity,
      pupil_mm: 3, wavelength_nm: 589.3 }).sharpness;
    return [eye.id, sharpestLens(value, [0, 0, 0], 1, 0.005).power];
  })));
  findings.pupil_magnification = await page.evaluate(() => {
    const living = window.emmetrope, eye = living.eyes[0];
    return [-8, 8].map((sphere_D) => new Beam(eye, { ...living.opening, gaze_deg: [0, 0], prism_D: 0, cylinder_D: 0, is_thick: false, vertex_distance_mm: 12, sphere_D },
      eye.map.reference_nm).pupilMagnification(0, 0));
  });
  // What is drawn follows exact rays: a mesh's corner polynomials against single rays through eye, gaze and lens.
  findings.beam_arcmin = await page.evaluate(() => {
    const living = window.emmetrope, eye = living.eyes[0];
    const state = { ...living.opening, sphere_D: -6, cylinder_D: -2, axis_deg: 35, prism_D: 3, prism_base_deg: 200, is_thick: true, gaze_deg: [12, -8], pupil_mm: 5 };
    const beam = new Beam(eye, state, 480), field = { x_mm: 0.8, y_mm: -0.5, size_mm: 3 }, mesh = beam.mesh(field, 0), terms = exponents(mesh.degree);
    let most = 0;
    for (const [i, j] of [[0, 0], [3, 17], [10, 10], [20, 5], [20, 20]])
      for (const [px, py] of [[0, 0], [0.7, 0.1], [-0.5, 0.8], [0, -0.99]]) {
        const exact = beam.ray(field.x_mm + field.size_mm * (i / meshCells - 0.5), field.y_mm + field.size_mm * (j / meshCells - 0.5), px, py);
        const first = 4 * mesh.rowTexels * (j * (meshCells + 1) + i), value = [0, 0];
        terms.forEach(([m, n], t) => [2, 3].forEach((c, k) => { value[k] += mesh.values[first + 4 * t + c] * px ** m * py ** n; }));
        most = Math.max(most, Math.hypot(value[0] - exact.to[0] / exact.to[2], value[1] - exact.to[1] / exact.to[2]) / radian * 60);
      }
    return most;
  });
  // A worn lens is each eye's own, also where it is only asked about: as its powers, not as no lens.
  findings.worn_sharpness = await page.evaluate(() => {
    const [eye] = window.emmetrope.eyes, sharpness = (change) => window.emmetrope.quality(eye.id, { ...window.emmetrope.opening, ...change }).sharpness;
    const lens = eye.lenses.find((one) => one.name === "best");
    if (!lens) return null;
    const { sphere_D, cylinder_D, axis_deg, vertex_distance_mm } = lens;
    return { worn: sharpness({ worn: "best" }), powers: sharpness({ sphere_D, cylinder_D, axis_deg, vertex_distance_mm }), none: sharpness({}) };
  });
  // A lens on the cornea can be worn, and then be another.
  findings.on_cornea = await page.evaluate(() => {
    window.emmetrope.set({ sphere_D: -1, vertex_distance_mm: 0 });
    return window.emmetrope.state().vertex_distance_mm;
  });
  // A lens that the eye does not have cannot be worn, and the state says what is.
  findings.worn = await page.evaluate(() => ["best", "known"].map((name) => {
    try { window.emmetrope.set({ worn: name }); } catch { return "refused"; }
    return window.emmetrope.state().worn;
  }));
  await page.context().close();
}

// 3. Every control by keyboard: what it says and what is seen follow.
if (!brief) {
  const page = await open();
  await page.evaluate(() => window.emmetrope.set({ samples: 16 }));
  await settled(page);
  await page.evaluate(async () => {  // as a slider is dragged
    for (const sphere_D of [-1, -0.9]) {
      window.emmetrope.set({ sphere_D });
      await window.emmetrope.quick(window.emmetrope.work);
    }
  });
  const canvas = page.locator(".living-stage canvas").first();
  const picture = async () => { await settled(page); return canvas.evaluate((element) => element.toDataURL()); };
  findings.unmoved = [];
  await page.evaluate(() => window.emmetrope.set({ cylinder_D: -1, prism_D: 1 }));
  let before = await picture();
  for (const label of ["Sphere", "Cylinder", "Axis", "Vertex distance", "Prism", "Base of the prism", "Pupil (iris)", "Accommodation", "Gaze, up", "Distance",
    "Width of the picture", "Off the axis, to the right", "Off the axis, up"]) {
    const slider = page.getByLabel(label, { exact: true }).first();
    if (!(await slider.isVisible())) continue;
    const said = await slider.getAttribute("aria-valuetext");
    await slider.focus();
    for (let k = 0; k < 4; ++k) await page.keyboard.press(["Accommodation", "Prism"].includes(label) ? "PageUp" : "ArrowRight");
    const after = await picture();
    if (after === before || await slider.getAttribute("aria-valuetext") === said) findings.unmoved.push(label);
    before = after;
  }
  for (const scene of ["dial", "siemens", "street", "page", "depth"]) {
    await page.evaluate((name) => window.emmetrope.set({ ...window.emmetrope.opening, scene: name }), scene);
    const after = await picture();
    if (after === before) findings.unmoved.push(scene);
    before = after;
    if (pictures) await canvas.screenshot({ path: `${folder}/scene-${scene}.png` });
  }
  // The axis by the line on the picture: a third of the way round.
  await page.evaluate(() => window.emmetrope.set({ ...window.emmetrope.opening, cylinder_D: -2, axis_deg: 0 }));
  const box = await canvas.boundingBox(), middle = [box.x + box.width / 2, box.y + box.height / 2], reach = box.width * 0.4;
  await page.mouse.move(middle[0] + reach, middle[1]);
  await page.mouse.down();
  await page.mouse.move(middle[0] - reach * Math.cos(Math.PI / 3), middle[1] - reach * Math.sin(Math.PI / 3), { steps: 3 });
  await page.mouse.up();
  findings.dragged_axis_deg = await page.evaluate(() => window.emmetrope.state().axis_deg);
  await page.getByRole("button", { name: "Best lens" }).click();
  findings.best = await page.evaluate(() => ({ now: window.emmetrope.quality().sharpness, none: window.emmetrope.quality(undefined, { sphere_D: 0, cylinder_D: 0 }).sharpness }));
  await page.getByRole("button", { name: "Hold this picture to compare" }).click();
  findings.held = await page.locator(".living-held").count();
  await page.getByRole("button", { name: "Let go" }).click();
  findings.let_go = await page.locator(".living-held").count() === 0;
  const download = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save the picture" }).click();
  findings.saved = (await download).suggestedFilename();
  await page.evaluate(() => window.emmetrope.set({ scene: "siemens", gaze_deg: [2, 0] }));
  await page.getByRole("button", { name: "Copy a link to this state" }).click();
  findings.state = await page.evaluate(() => window.emmetrope.state());
  findings.hash = await page.evaluate(() => location.hash);
  const before_refusals = await page.evaluate(() => window.emmetrope.state());
  // By set() and by quality() alike.
  findings.refused = await page.evaluate(() => [["scene", "none"], ["eye", "none"], ["sphere", 1], ["sphere_D", "2"], ["sphere_D", NaN], ["gaze_deg", 5],
    ["wavelength_nm", 300], ["samples", -1], ["worn", "none"], ["pupil_mm", "3"], ["distance_mm", 0], ["band", 7],
    ["band_share", 0.5], ["pupil_mm", 40], ["pupil_mm", 0.5], ["accommodation_D", 20], ["field_mm", 20], ["field_x_mm", 9]].map(([key, value]) => [
    () => window.emmetrope.set({ [key]: value }),
    () => key === "eye" ? window.emmetrope.quality(value) : window.emmetrope.quality(undefined, { [key]: value }),
  ].map((act) => { try { act(); return ""; } catch (fault) { return fault.message; } })));
  findings.moved_by_refusals = JSON.stringify(await page.evaluate(() => window.emmetrope.state())) !== JSON.stringify(before_refusals);
  findings.kept_axis_deg = await page.evaluate(() => [185, 180, 5].map((axis_deg) => {
    window.emmetrope.set({ axis_deg });
    return window.emmetrope.state().axis_deg;
  }));
  // Pictures asked for at once come one after the other; one that a change overtakes says so.
  findings.images = await page.evaluate(async () => {
    window.emmetrope.set({ samples: 16 });
    const both = await Promise.all([window.emmetrope.image({ width: 64 }), window.emmetrope.image({ width: 32 })]);
    const overtaken = window.emmetrope.image();
    await new Promise((resolve) => setTimeout(resolve, 20));
    window.emmetrope.set({ sphere_D: 1 });
    return [...both.map((image) => image.width), await overtaken.then(() => "", (fault) => fault.message)];
  });
  // What an eye sees of a far point does not depend on where it looks.
  findings.gaze_blur = await page.evaluate(() => [0, 30].map((angle) => window.emmetrope.quality(undefined, { ...window.emmetrope.opening, distance_mm: 1e9, gaze_deg: [angle, 0] }).blur_arcmin));
  if (pictures) await page.screenshot({ path: `${folder}/desktop.png`, fullPage: true });
  await page.context().close();
  const again = await open({ hash: findings.hash });
  findings.state_by_link = await again.evaluate(() => window.emmetrope.state());
  await again.context().close();
  const beyond = await open({ hash: `#living=${encodeURIComponent(JSON.stringify({ pupil_mm: 40, worn: "known", sphere_D: -1 }))}` });
  findings.state_by_link_beyond = await beyond.evaluate(() => window.emmetrope.state());
  await beyond.context().close();
}

// 4. Both colour schemes and widths, to a reader who needs contrast, names and order; on paper it is gone.
for (const [scheme, width] of brief ? [] : [["light", 1280], ["dark", 1280], ["light", 400], ["dark", 400]]) {
  const page = await open({ bypassCSP: true, colorScheme: scheme, reducedMotion: "reduce", viewport: { width, height: 812 } });
  await page.evaluate((samples) => window.emmetrope.set({ samples }), pictures ? 256 : 16);
  await settled(page);
  await page.addScriptTag({ path: axe });
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  findings.accessibility[`${scheme} ${width}`] = found.violations.filter((violation) => ["serious", "critical"].includes(violation.impact))
    .map((violation) => `${violation.id}: ${violation.nodes.slice(0, 3).map((node) => node.target).join("; ")}`);
  findings.layout[width] = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((element) => {
    const box = element.getBoundingClientRect();
    return box.width > 0 && box.right > document.documentElement.clientWidth + 1 && !element.closest(".scroll, pre, .skip, nav ul");
  }).map((element) => `${element.tagName}.${element.className?.baseVal ?? element.className}`).slice(0, 5));
  if (pictures) await page.screenshot({ path: `${folder}/${scheme}-${width}.png`, fullPage: true });
  await page.emulateMedia({ media: "print" });
  findings.printed = await page.locator(".living:visible").count();
  await page.context().close();
}

// 5. A browser without WebGL says so.
if (!brief) {
  const page = await open({ before: () => {
    const plain = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : plain.call(this, kind, ...rest); };
  } });
  findings.without_webgl = await page.locator(".living-status").innerText();
  findings.controls_without_webgl = await page.locator(".living-controls:visible").count();
  await page.context().close();
}
await browser.close();
writeFileSync(`${folder}/findings.json`, JSON.stringify(findings, null, 1));
