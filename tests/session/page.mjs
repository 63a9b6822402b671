// Drives the page of `cutis serve` in a headless Chromium as a person would, and takes pictures.
//   node page.mjs FOLDER_OF_NODE_MODULES URL FOLDER_OF_PICTURES
// FOLDER_OF_NODE_MODULES has puppeteer-core and @sparticuz/chromium: npm install puppeteer-core @sparticuz/chromium
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import { resolve, join } from "node:path";
const [folder, url, out] = process.argv.slice(2);
const require = createRequire(pathToFileURL(join(resolve(folder), "node_modules", "x.js")));
const module = async (name) => (await import(pathToFileURL(require.resolve(name)))).default;
const [chromium, puppeteer] = [await module("@sparticuz/chromium"), await module("puppeteer-core")];
const browser = await puppeteer.launch({
  executablePath: await chromium.executablePath(),
  headless: "shell",
  args: [...chromium.args, "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"],
  defaultViewport: { width: 1280, height: 800 },
});
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const must = (holds, what) => { if (!holds) throw new Error(what); };
try {
  const open = async () => {
    const page = await browser.newPage();
    page.faults = [];
    page.on("pageerror", (error) => page.faults.push(String(error)));
    page.on("console", (message) => message.type() === "error" && page.faults.push(message.text()));
    await page.goto(url, { waitUntil: "domcontentloaded" });
    await page.waitForFunction(() => window.cutis?.drawn > 0 && window.cutis.figures, { timeout: 120000 });
    return page;
  };
  const page = await open();
  const seen = (what) => page.evaluate(`window.cutis.${what}`);
  const until = (expression, ms = 240000) => page.waitForFunction(expression, { timeout: ms, polling: 100 });
  const picture = async (name, of = page) => { await wait(500); await of.screenshot({ path: join(out, `${name}.png`) }); };
  // colours of the canvas: something is drawn in it
  const colors = () => page.evaluate(() => {
    const view = document.getElementById("view"), copy = document.createElement("canvas");
    copy.width = 160; copy.height = 100;
    const pen = copy.getContext("2d");
    pen.drawImage(view, 0, 0, 160, 100);
    const { data } = pen.getImageData(0, 0, 160, 100), found = new Set();
    for (let k = 0; k < data.length; k += 4) found.add((data[k] >> 3) * 1024 + (data[k + 1] >> 3) * 32 + (data[k + 2] >> 3));
    return found.size;
  });
  await picture("1_opened");
  must((await colors()) > 20, "the picture shows little more than its background");
  // run on the recorded hand, as it is at the start
  if (!(await seen("figures.playing"))) await page.click("#play");
  await until(() => window.cutis.figures.time_s > 0.02);
  await page.click("#play");
  await until(() => !window.cutis.figures.playing);
  const stood = await seen("figures.time_s");
  await page.click("#step");
  await page.waitForFunction((t) => window.cutis.figures.time_s > t, { timeout: 60000 }, stood);
  // take the tool, lower it by the wheel, cut with the button
  await page.click("#reset");
  await until(() => window.cutis.figures.time_s === 0);
  await page.click("#tools button");
  const box = await (await page.$("#view")).boundingBox(), middle = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(...middle);
  for (let k = 0; k < 13; k++) await page.mouse.wheel({ deltaY: 200 });
  await page.click("#play");
  await page.mouse.move(...middle);
  await page.mouse.down();
  await until(() => window.cutis.figures.force_n[0] > 0.01);
  await picture("2_pressed");
  for (let k = 1; k <= 60 && (await seen("figures.severed")) < 6; k++) {
    await page.mouse.move(middle[0] - 4 * k, middle[1] + 2 * k);
    await wait(150);
  }
  await until(() => window.cutis.figures.severed >= 3);
  await page.mouse.up();
  for (let k = 0; k < 20; k++) await page.mouse.wheel({ deltaY: -200 });
  await until(() => window.cutis.figures.contacts === 0 && window.cutis.surface.kinds.some((kind, k) => k % 4 === 1 && kind === 1));
  await picture("3_cut");
  must((await seen("errors.length")) === 0, await seen("errors.join()"));
  // a game pad moves the tool in hand along the picture and lets it go
  await page.evaluate(() => {
    const pad = (window.pad_of_test = { connected: true, mapping: "standard", axes: [0, 0, 0, 0], buttons: Array.from({ length: 16 }, () => ({ pressed: false })) });
    navigator.getGamepads = () => [null, pad];
  });
  const before = await seen("tools[0].hand.slice()");
  await page.evaluate(() => (window.pad_of_test.axes = [1, 0, 0, -1]));
  await page.waitForFunction(([x, y, z]) => { const [a, b, c] = window.cutis.tools[0].hand; return Math.hypot(a - x, b - y) > 2e-3 && c > z + 1e-3; }, { timeout: 60000 }, before);
  await page.evaluate(() => (window.pad_of_test.axes = [0.1, -0.1, 0.1, 0]));
  await page.evaluate(() => (window.pad_of_test.buttons[8].pressed = true));
  await until(() => window.cutis.taken === -1, 60000);
  await page.evaluate(() => (navigator.getGamepads = () => []));
  // a second page, colours, wires, cut open, back
  const second = await open();
  await until(() => window.cutis.figures.pages === 2);
  await second.select("#colors", "von_mises");
  await second.click("#wires");
  await second.evaluate(() => { const clip = document.getElementById("clip"); clip.value = 0.5; clip.oninput(); clip.onchange(); });
  // both pages show it
  for (const of of [second, page]) {
    await of.waitForFunction(() => window.cutis.figures.look.plane && window.cutis.slice?.vertices > 0 && window.cutis.slice.values.some((v) => v > 0.2), { timeout: 60000 });
    must((await of.evaluate(() => document.getElementById("colors").value)) === "von_mises", "the pages differ");
  }
  await picture("4_second", second);
  await second.select("#colors", "");
  await second.evaluate(() => { const clip = document.getElementById("clip"); clip.value = 0; clip.oninput(); clip.onchange(); });
  await page.waitForFunction(() => window.cutis.slice.vertices === 0 && window.cutis.quantity === 0, { timeout: 60000 });
  must(second.faults.length === 0, second.faults.join("\n"));
  await second.close();
  await page.click("#play");
  await until(() => !window.cutis.figures.playing);
  await page.evaluate(() => { const seek = document.getElementById("seek"); seek.value = 0; seek.oninput(); seek.onchange(); });
  await until(() => window.cutis.figures.time_s === 0 && window.cutis.figures.severed === 0);
  await picture("5_back");
  must(page.faults.length === 0, page.faults.join("\n"));
  console.log("the page holds");
} finally {
  await browser.close();
}
