// Input by pointer, wheel, keys and sliders, and the text that the page shows.
let largest = Infinity;  // pixels a side that an image may have

function moveEye(x, y, z) {
  const [wide, high] = zone, far = display.distance_mm;
  state.eye = [between(x, -wide * 0.75, wide * 0.75), between(y, -high * 0.75, high * 0.75),
               between(z, far * 0.4, far * 2.5)];
  resize();
  redraw();
}

function tell() {
  const [x, y, z] = state.eye.map(Math.round), at = display.distance_mm / state.eye[2];
  const outside = [0, 1].some(axis => Math.abs(state.eye[axis]) * at > zone[axis] / 2);
  const side = (mm, plus, minus) => `${Math.abs(mm)} mm ${mm < 0 ? minus : plus}`;
  find("where").textContent = `eye ${side(x, "right", "left")}, ${side(y, "up", "down")}, ${z} mm in front` +
    (state.aperture ? `, focus ${side(Math.round(state.focus), "in front", "behind")}` : "") +
    (outside ? " – outside the viewing zone, where a real display repeats its image" : "");
  find("mode").value = state.mode;
  find("stereo").value = state.stereo;
  find("eyes").value = state.eyes;
  find("eyesLabel").hidden = state.stereo === "one";
  find("aperture").value = state.aperture;
  find("focus").value = state.focus;
  find("frame").value = state.frame;
  find("frameName").textContent = display.labels[state.frame];
  find("sway").setAttribute("aria-pressed", swaying);
  find("play").setAttribute("aria-pressed", playing);
  drawMap();
}

// Draw display, viewing zone and eye from above, to scale, with a scale bar of 100, 200, 500 … mm.
function drawMap() {
  const {panel_mm: [wide], distance_mm: far} = display, reach = Math.max(far * 1.5, state.eye[2] * 1.1);
  const scale = 140 / Math.max(reach, wide, zone[0] * 1.6), x = mm => 75 + mm * scale, y = mm => 6 + mm * scale;
  const bar = [20, 50, 100, 200, 500, 1000, 2000, 5000].findLast(mm => mm * scale <= 60) ?? 10;
  find("map").setAttribute("viewBox", "0 0 150 150");
  find("map").innerHTML = `
    <path d="M${x(-wide / 2)} ${y(0)} L${x(-zone[0] / 2)} ${y(far)} H${x(zone[0] / 2)} L${x(wide / 2)} ${y(0)} Z"
      fill="#6af2" stroke="#6af8"/>
    <path d="M${x(-wide / 2)} ${y(0)} H${x(wide / 2)}" stroke="#eee" stroke-width="4"/>
    <circle cx="${x(state.eye[0])}" cy="${y(state.eye[2])}" r="4" fill="#fc6"/>
    <path d="M4 142 H${4 + bar * scale}" stroke="#aaa" stroke-width="2"/>
    <text x="4" y="136" fill="#aaa" font-size="10">${bar} mm</text>`;
}

function setSway(on) {
  swaying = on;
  swayStart = performance.now();
  paces = [];
  redraw();
}

function setFrame(frame) {
  state.frame = between(Math.round(frame), 0, display.labels.length - 1);
  return show(state.frame).then(redraw);
}

function setStereo(value) {
  state.stereo = value;
  resize();
  redraw();
}

function reset() {
  Object.assign(state, structuredClone(START), {frame: state.frame});
  setSway(false);
  resize();
  redraw();
}

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().catch(() => note("This browser shows no page in full screen."));
}

function focusAt(event) {
  let x = event.offsetX * layout.ratio;
  const wide = layout.x * 2;
  if (state.stereo === "side" && x >= wide) x -= wide;
  state.focus = depthAt((x - layout.x) / layout.scale, (layout.y - event.offsetY * layout.ratio) / layout.scale);
  if (!state.aperture) state.aperture = 0.2;
  redraw();
}

const next = (list, value) => list[(list.indexOf(value) + 1) % list.length];
const step = () => [zone[0] / 20, zone[1] / 20];
const KEYS = {
  ArrowLeft: () => look(-1, 0), ArrowRight: () => look(1, 0), ArrowUp: () => look(0, 1), ArrowDown: () => look(0, -1),
  "+": () => stepNearer(0.95), "=": () => stepNearer(0.95), "-": () => stepNearer(1 / 0.95),
  m: () => { state.mode = next(["smooth", "physical"], state.mode); },
  s: () => setStereo(next(["one", "side", "anaglyph"], state.stereo)),
  " ": () => setSway(!swaying), f: fullScreen, 0: reset, p: () => { playing = !playing; },
  ",": () => { setFrame(state.frame - 1); }, ".": () => { setFrame(state.frame + 1); },
  "[": () => { state.focus = Math.max(state.focus - display.distance_mm / 100, depthOf(FARTHEST)); },
  "]": () => { state.focus = Math.min(state.focus + display.distance_mm / 100, depthOf(NEAREST)); },
  a: () => { state.aperture = Math.min(1, state.aperture + 0.05); },
  A: () => { state.aperture = Math.max(0, state.aperture - 0.05); },
};

function look(right, up) {
  setSway(false);
  moveEye(state.eye[0] + right * step()[0], state.eye[1] + up * step()[1], state.eye[2]);
}

function stepNearer(factor) { moveEye(state.eye[0], state.eye[1], state.eye[2] * factor); }

function onKey(event) {
  const own = event.target.closest("input, select, button, summary");
  const action = KEYS[event.key] ?? KEYS[event.key.toLowerCase()];
  if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
  if (own && (event.key.startsWith("Arrow") || event.key === " " || own.tagName === "SELECT")) return;
  event.preventDefault();
  action();
  redraw();
}

const pointers = new Map();
let moved = 0, spread = 0;

function onPointer(event) {
  if (event.type === "pointerdown") {
    canvas.setPointerCapture(event.pointerId);
    moved = pointers.size ? Infinity : 0;
    pointers.set(event.pointerId, event);
    spread = distance();
  } else if (event.type === "pointermove" && pointers.has(event.pointerId)) {
    const before = pointers.get(event.pointerId);
    pointers.set(event.pointerId, event);
    if (pointers.size === 2) pinch();
    else drag(event.clientX - before.clientX, event.clientY - before.clientY);
  } else if (event.type === "pointerup" && pointers.delete(event.pointerId) && moved < 5) {
    focusAt(event);
  } else if (event.type === "pointercancel") {
    pointers.delete(event.pointerId);
  }
}

function distance() {
  const [a, b] = [...pointers.values()];
  return b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
}

function pinch() {
  const now = distance();
  if (spread && now) stepNearer(spread / now);
  spread = now;
}

function drag(right, down) {
  moved += Math.abs(right) + Math.abs(down);
  if (moved < 5) return;
  setSway(false);
  const perPixel = zone[0] / (display.panel_mm[0] * layout.scale / layout.ratio);
  moveEye(state.eye[0] + right * perPixel, state.eye[1] - down * perPixel, state.eye[2]);
}

let played = 0;
function tick(now) {
  if (swaying) {
    const angle = (now - swayStart) / 5000 * 2 * Math.PI;
    moveEye(zone[0] * 0.4 * Math.sin(angle), zone[1] * 0.12 * (1 - Math.cos(angle)), state.eye[2]);
  }
  if (playing && now - played > 1000 / 12) {
    played = Infinity;  // the next is due when this one is shown
    setFrame((state.frame + 1) % display.labels.length).then(() => { played = performance.now(); });
  }
  const hurried = (pupilSamples() > 1 && now - changed < SETTLED) || (swaying && slow);
  if (hurried !== quick) {
    quick = hurried;
    if (quick) resize();
    else enlarge();
  }
  if (dirty) {
    dirty = false;
    strip = {from: 0, rows: pupilSamples() === PUPIL ? 8 : canvas.height};
    tell();
  }
  if (strip.from < canvas.height) drawStrip();
  if (!swaying && !playing && now - changed > 4 * SETTLED) speak();
  requestAnimationFrame(tick);
}

// Tell screen readers where the eye rests: not every frame of its way.
function speak() {
  const [spoken, where] = [find("spoken"), find("where").textContent];
  if (spoken.textContent !== where) spoken.textContent = where;
}

// Values in the address by their names: what they must be, and how each is used; undefined where it is none.
const ADDRESS = {
  eye: ["X,Y,Z in millimetres", text => {
    const eye = text.split(",").map(part => part.trim() ? Number(part) : NaN);
    return eye.length === 3 && eye.every(Number.isFinite) && eye[2] > 0 ? () => moveEye(...eye) : undefined;
  }],
  mode: ["smooth or physical", text => ["smooth", "physical"].includes(text) ? () => { state.mode = text; } : undefined],
  stereo: ["one, side or anaglyph", text => ["one", "side", "anaglyph"].includes(text) ? () => setStereo(text) : undefined],
  texture: ["pixels a side", text => Number(text) >= 1 ? () => { largest = Number(text); } : undefined],
};

function readAddress() {
  const options = new URLSearchParams(location.hash.slice(1)), wrong = [];
  for (const [name, [rule, read]] of Object.entries(ADDRESS)) {
    if (!options.has(name)) continue;
    const use = read(options.get(name));
    if (use) use();
    else wrong.push(`${name}=${options.get(name)} in the address was ignored: expected ${rule}.`);
  }
  if (wrong.length) note(wrong.join(" "));
  return options.has("eye");
}

function listen() {
  for (const kind of ["pointerdown", "pointermove", "pointerup", "pointercancel"]) canvas.addEventListener(kind, onPointer);
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    stepNearer(Math.exp(between(event.deltaY, -200, 200) / 1000));
  }, {passive: false});
  addEventListener("keydown", onKey);
  addEventListener("resize", resize);
  find("controls").addEventListener("toggle", resize, true);
  find("mode").onchange = event => { state.mode = event.target.value; redraw(); };
  find("stereo").onchange = event => setStereo(event.target.value);
  for (const name of ["eyes", "aperture", "focus"])
    find(name).oninput = event => { state[name] = Number(event.target.value); redraw(); };
  find("frame").oninput = event => setFrame(Number(event.target.value));
  find("sway").onclick = () => setSway(!swaying);
  find("play").onclick = () => { playing = !playing; redraw(); };
  find("reset").onclick = reset;
  find("save").onclick = save;
  find("full").onclick = fullScreen;
  canvas.addEventListener("webglcontextlost", () => note("The GPU lost the image: load the page again."));
}

function describe() {
  const [wide, high] = display.panel_mm.map(mm => Math.round(mm));
  find("name").textContent = display.name;
  find("size").textContent = `${wide} × ${high} mm, ${display.lenses.join(" × ")} lenses of ${display.views.join(" × ")} ` +
    `views, seen from ${Math.round(display.distance_mm)} mm within ${Math.round(display.angle_deg)}°`;
  Object.assign(find("focus"), {min: Math.round(depthOf(FARTHEST)), max: Math.round(depthOf(NEAREST)), step: 1});
  find("frame").max = display.labels.length - 1;
  for (const name of ["frameLabel", "play"]) find(name).hidden = display.labels.length < 2;
  tell();
}

function showStill() {
  note("This browser has no WebGL 2, so this is a still image from the middle: a current browser lets you look around.");
  for (const name of ["controls", "map", "where"]) find(name).hidden = true;
  addEventListener("resize", resize);
  resize();
}

async function start() {
  describe();
  if (gl) {
    setUp();
    const placed = readAddress();
    listen();
    resize();
    await setFrame(0);
    setSway(!reducedMotion.matches && !placed);
    requestAnimationFrame(tick);
  } else {
    showStill();
  }
  document.documentElement.dataset.ready = "true";
}

start();
