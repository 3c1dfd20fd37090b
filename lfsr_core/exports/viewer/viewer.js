"use strict";
const find = id => document.getElementById(id);
const display = JSON.parse(find("data").textContent);
const canvas = find("image");
const gl = canvas.getContext("webgl2", {antialias: false, alpha: false, preserveDrawingBuffer: true});
const zone = display.views.map(count => count * display.spacing_mm);  // across and down, at the viewing distance
const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
const START = {eye: [0, 0, display.distance_mm], mode: "smooth", stereo: "one", eyes: 63, aperture: 0, focus: 0, frame: 0};
// Depths that a click compares to find the focus, and the ends of the slider, as relative sizes of things there.
const DEPTHS = 160, FARTHEST = -0.5, NEAREST = 0.8;
// Samples of a pupil at rest, and while anything changes: then also a quarter of the pixels, until nothing has for so long.
const PUPIL = 48, QUICK_PUPIL = 10, SETTLED = 250;
// Milliseconds that a strip of the image at rest may take, and an image while the eye sways: at more, a quarter of the
// pixels is drawn, and where that takes over STILL the eye rests.
const STRIP = 40, FLUENT = 60, STILL = 250, PACED = 4;
const state = structuredClone(START);
const layout = {};  // where the display is in the canvas: centre and pixels per millimetre
const textures = new Map();  // by frame, those used last at the end
let program, places = {}, dirty = true, changed = 0, quick = false, swaying = false, swayStart = 0, playing = false, showing = -1;
let strip = {from: Infinity, rows: 0}, paces = [], slow = false;

const between = (value, low, high) => Math.min(Math.max(value, low), high);
const note = text => { find("note").textContent = text; };

// Millimetres in front of the display at which things look larger by this fraction.
const depthOf = larger => display.distance_mm - display.distance_mm / (1 + larger);

function compile(kind, source) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source.trim());
  gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw Error(gl.getShaderInfoLog(shader));
  return shader;
}

function setUp() {
  program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, `#version 300 es
    void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0, 1); }`));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, find("shader").textContent));
  gl.linkProgram(program);
  gl.useProgram(program);
  places = new Proxy({}, {get: (known, name) => known[name] ??= gl.getUniformLocation(program, name)});
  gl.uniform2iv(places.lenses, display.lenses);
  gl.uniform2iv(places.views, display.views);
  gl.uniform1i(places.flipped, display.flipped ? 1 : 0);
  gl.uniform2fv(places.panel, display.panel_mm);
  gl.uniform1f(places.viewDistance, display.distance_mm);
  gl.uniform1f(places.spacing, display.spacing_mm);
  gl.uniform1i(places.seen, 1);
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, newTexture());
  gl.activeTexture(gl.TEXTURE0);
}

function newTexture() {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  return texture;
}

// Panel pixel that an eye sees through each lens along one axis, as in optics/eye.py.
function seenPixels(eye, axis) {
  const count = display.lenses[axis], length = display.panel_mm[axis], {distance_mm: far, gap_mm: gap} = display;
  return Int32Array.from({length: count}, (_, index) => {
    if (display.views[axis] === 1) return index;  // the same for every eye
    const lens = ((index + 0.5) / count - 0.5) * length * far / (far + gap);
    const onPanel = lens + (lens - eye[axis]) * gap / eye[2];
    return Math.floor((onPanel / length + 0.5) * (count * display.views[axis]));
  });
}

function placeLenses(eye) {
  const [across, up] = [0, 1].map(axis => seenPixels(eye, axis)), width = Math.max(across.length, up.length);
  const both = new Int32Array(width * 2);
  both.set(across, 0);
  both.set(up, width);
  gl.activeTexture(gl.TEXTURE1);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32I, width, 2, 0, gl.RED_INTEGER, gl.INT, both);
  gl.activeTexture(gl.TEXTURE0);
}

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const decoded = atob(text), bytes = new Uint8Array(decoded.length);
  for (let i = 0; i < decoded.length; i++) bytes[i] = decoded.charCodeAt(i);
  return bytes;
}

async function load(frame) {
  const exact = {colorSpaceConversion: "none", premultiplyAlpha: "none"};
  const blob = new Blob([bytesOf(document.getElementsByClassName("eia")[frame].textContent)], {type: "image/webp"});
  let bitmap = await createImageBitmap(blob, exact), fitted = [bitmap.width, bitmap.height];
  const most = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE), largest);
  while (Math.max(...fitted) > most) fitted = fitted.map(length => Math.floor(length / 2));
  if (fitted[0] < bitmap.width) {
    note(`This GPU takes ${most} pixels a side: the image is shown at ${fitted[0]}×${fitted[1]} of ` +
         `${bitmap.width}×${bitmap.height}.`);
    bitmap.close();
    bitmap = await createImageBitmap(blob, {...exact, resizeWidth: fitted[0], resizeHeight: fitted[1],
                                            resizeQuality: "medium"});
  }
  const texture = newTexture();
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
  bitmap.close();
  const scale = fitted.map((length, axis) => length / (display.lenses[axis] * display.views[axis]));
  return {texture, bytes: fitted[0] * fitted[1] * 4, scale};
}

async function show(frame) {
  showing = frame;
  const loaded = textures.get(frame) ?? await load(frame);
  textures.delete(frame);
  textures.set(frame, loaded);
  for (const [old, {texture}] of textures) {
    if (textures.size * loaded.bytes <= 1e9 || old === frame) break;
    gl.deleteTexture(texture);
    textures.delete(old);
  }
  if (showing === frame) redraw();
}

function redraw() {
  dirty = true;
  changed = performance.now();
}

function pupilSamples() { return !state.aperture || state.mode === "physical" ? 1 : quick ? QUICK_PUPIL : PUPIL; }

// Draw what one eye sees into a viewport; `area` is its lower left corner and millimetres per pixel.
function drawEye(eye, viewport, area) {
  gl.viewport(...viewport);
  gl.scissor(viewport[0], Math.max(viewport[1], strip.from), viewport[2], Math.min(viewport[3], strip.rows));
  placeLenses(eye);
  gl.uniform3fv(places.eye, eye);
  gl.uniform1f(places.focus, between(state.focus, -1e6, Math.min(eye[2], display.distance_mm) * 0.9));
  gl.uniform1f(places.aperture, state.aperture * zone[0]);
  gl.uniform1i(places.pupil, pupilSamples());
  gl.uniform1i(places.mode, state.mode === "physical" ? 1 : 0);
  gl.uniform2f(places.corner, area.left - viewport[0] * area.step, area.bottom - viewport[1] * area.step);
  gl.uniform2f(places.perPixel, area.step, area.step);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

function bind() {
  const current = textures.get(showing) ?? [...textures.values()].at(-1);
  if (!current) return false;
  gl.bindTexture(gl.TEXTURE_2D, current.texture);
  gl.uniform2fv(places.texelsPerPixel, current.scale);
  return true;
}

function eyePair() {
  const [x, y, z] = state.eye, half = state.eyes / 2;
  return [[x - half, y, z], [x + half, y, z]];
}

// Draw the next strip of the image: all of it, or at rest with a pupil as many rows as take STRIP milliseconds.
function drawStrip() {
  const began = performance.now(), all = strip.rows >= canvas.height;
  draw();
  if (!all || swaying) gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // waits for the image
  const took = performance.now() - began;
  strip.from += strip.rows;
  if (!all) strip.rows = Math.round(between(strip.rows * STRIP / Math.max(took, 1), 1, 4 * strip.rows));
  else if (swaying && paces.length < PACED) paces.push(took);
  else if (swaying && Math.min(...paces) > FLUENT) slower();
}

// Too slow to sway at this size: at a quarter of the pixels, else not at all.
function slower() {
  if (slow && Math.min(...paces) > STILL) {
    setSway(false);
    note("This machine draws slowly, so the image stands still: drag to look around.");
  }
  slow = true;
  paces = [];
}

// The canvas at its full size, with the image that it shows until the strips are drawn.
function enlarge() {
  const {width, height} = canvas, texture = newTexture(), buffer = gl.createFramebuffer();
  gl.copyTexImage2D(gl.TEXTURE_2D, 0, gl.RGB, 0, 0, width, height, 0);
  resize();
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, buffer);
  gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.disable(gl.SCISSOR_TEST);
  gl.blitFramebuffer(0, 0, width, height, 0, 0, canvas.width, canvas.height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  gl.deleteFramebuffer(buffer);
  gl.deleteTexture(texture);
}

function draw() {
  if (!bind()) return;
  find("still").hidden = true;
  const {width, height} = canvas, step = 1 / layout.scale, [left, right] = eyePair(), half = Math.floor(width / 2);
  const area = (w) => ({left: -w / 2 * step, bottom: (layout.y - height) * step, step});
  gl.enable(gl.SCISSOR_TEST);
  if (state.stereo === "side") {
    drawEye(left, [0, 0, half, height], area(half));
    drawEye(right, [half, 0, half, height], area(half));
  } else if (state.stereo === "anaglyph") {
    gl.colorMask(true, false, false, true);
    drawEye(left, [0, 0, width, height], area(width));
    gl.colorMask(false, true, true, true);
    drawEye(right, [0, 0, width, height], area(width));
    gl.colorMask(true, true, true, true);
  } else {
    drawEye(state.eye, [0, 0, width, height], area(width));
  }
}

// Pixels of the display alone, rows from the top, RGBA; `draw_` draws into a framebuffer of that size.
function offScreen(width, height, draw_) {
  const buffer = gl.createFramebuffer(), texture = gl.createTexture(), pixels = new Uint8Array(width * height * 4);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const before = [quick, strip];
  [quick, strip] = [false, {from: 0, rows: height}];
  if (bind()) draw_();
  [quick, strip] = before;
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(buffer);
  gl.deleteTexture(texture);
  return pixels;
}

function snapshot(width) {
  const [wide, high] = display.panel_mm, height = Math.round(width * high / wide), step = wide / width;
  const area = {left: -wide / 2, bottom: -height * step / 2, step};
  const rows = offScreen(width, height, () => drawEye(state.eye, [0, 0, width, height], area));
  const image = new ImageData(width, height);
  for (let y = 0; y < height; y++)
    image.data.set(rows.subarray((height - 1 - y) * width * 4, (height - y) * width * 4), y * width * 4);
  return image;
}

function save() {
  const image = snapshot(Math.min(3840, Math.max(1920, display.lenses[0])));
  const page = Object.assign(document.createElement("canvas"), {width: image.width, height: image.height});
  page.getContext("2d").putImageData(image, 0, 0);
  page.toBlob(blob => {
    const link = Object.assign(document.createElement("a"), {download: `${display.name}.png`});
    link.href = URL.createObjectURL(blob);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

// Depth at which cameras agree best about a place on the display; of equal depths the nearest to the display.
function depthAt(x, y) {
  const step = (NEAREST - FARTHEST) / (DEPTHS - 1);
  const pixels = offScreen(DEPTHS, 1, () => {
    gl.viewport(0, 0, DEPTHS, 1);
    gl.scissor(0, 0, DEPTHS, 1);
    gl.uniform3fv(places.eye, state.eye);
    gl.uniform1i(places.mode, 2);
    gl.uniform1f(places.farthest, FARTHEST);
    gl.uniform1f(places.depthStep, step);
    gl.uniform2f(places.target, x, y);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  });
  const values = Array.from({length: DEPTHS}, (_, i) => pixels[i * 4] + pixels[i * 4 + 1] / 255);
  const least = Math.min(...values) * 1.03 + 0.05;
  const good = values.map((value, i) => [value, FARTHEST + i * step]).filter(([value]) => value <= least);
  return depthOf(good.reduce((a, b) => Math.abs(a[1]) <= Math.abs(b[1]) ? a : b)[1]);
}

// The display below the caption, as far as one line of the eye's place reaches, and above the controls.
function resize() {
  const ratio = Math.min(devicePixelRatio || 1, 2) * (quick ? 0.5 : 1);
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  const top = (find("where").offsetTop + 34) * ratio;
  const free = Math.max(1, canvas.height - top - find("controls").offsetHeight * ratio);
  const across = canvas.width / (state.stereo === "side" ? 2 : 1);
  const fit = Math.min(across * 0.9 / display.panel_mm[0], free * 0.92 / display.panel_mm[1]);
  layout.ratio = ratio;
  layout.scale = fit * display.distance_mm / state.eye[2];  // a display looks larger from nearer
  layout.y = top + free / 2;
  layout.x = across / 2;
  placeStill();
  dirty = true;
}

// The small image of the middle, until the EIA is there, where the display will be.
function placeStill() {
  const [width, height] = display.panel_mm.map(mm => mm * layout.scale / layout.ratio);
  Object.assign(find("still").style, {
    inset: "auto", margin: 0, maxWidth: "none", left: `${layout.x / layout.ratio - width / 2}px`,
    top: `${layout.y / layout.ratio - height / 2}px`, width: `${width}px`, height: `${height}px`});
}
