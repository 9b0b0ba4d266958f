/* What the page does when it is used: turn the picture, choose a hypothesis, overlays and layers, point at a reading. */

const byId = (id) => document.getElementById(id);
const scene = JSON.parse(byId("scene").textContent);
let picture = null;
try {
  picture = new Picture(byId("view"), byId("overlay"), scene);
} catch (error) {
  byId("view").hidden = true;
  byId("no3d").hidden = false;
  byId("no3d").textContent = `This browser cannot draw the picture (${error.message}). Everything else on this page is complete.`;
}

function overlaysNow() {
  return [...document.querySelectorAll(".overlays")].find((e) => !e.hidden)?.querySelector("select");
}

function showWay(way) {
  const select = overlaysNow();
  if (!select) return;
  select.value = way;
  select.dispatchEvent(new Event("change"));
  byId("view").scrollIntoView({ block: "nearest" });
}

function choose(k) {
  for (const piece of document.querySelectorAll("[data-h]")) piece.hidden = piece.dataset.h !== String(k);
  if (!picture) return;
  picture.chosen = k;
  picture.way = overlaysNow()?.value ?? "";
  picture.redraw();
}
for (const radio of document.querySelectorAll("input[name=hypothesis]")) {
  radio.addEventListener("change", () => choose(Number(radio.value)));
}
const checked = document.querySelector("input[name=hypothesis]:checked");
choose(checked ? Number(checked.value) : 0);

byId("copy").addEventListener("click", async () => {
  const words = byId("command").textContent;
  try {
    await navigator.clipboard.writeText(words);
  } catch {
    getSelection().selectAllChildren(byId("command"));
  }
  byId("copy").textContent = "Copied";
});

/* A phone shows the first section; the others open by a touch. On paper all are open, and the picture is an image. */
const folds = [...document.querySelectorAll(".fold")];
if (window.matchMedia("(max-width: 600px)").matches) {
  folds.forEach((fold, k) => { fold.open = k === 0; });
  if (document.documentElement.scrollHeight > 3000) folds[0].open = false;
}
let opened = [];
window.addEventListener("beforeprint", () => {
  opened = folds.filter((fold) => !fold.open);
  opened.forEach((fold) => { fold.open = true; });
  if (picture) {
    const image = Object.assign(new Image(), { src: picture.still(), id: "printed", className: "printed", alt: "The part with the readings" });
    byId("view").after(image);
  }
});
window.addEventListener("afterprint", () => {
  opened.forEach((fold) => { fold.open = false; });
  byId("printed")?.remove();
});

if (picture) {
  for (const select of document.querySelectorAll(".overlays select")) {
    select.addEventListener("change", () => { picture.way = select.value; picture.redraw(); });
  }
  for (const box of document.querySelectorAll("[data-layer]")) {
    const apply = () => { picture.layers[box.dataset.layer] = box.checked; picture.redraw(); };
    box.addEventListener("change", apply);
    apply();
  }
  for (const button of document.querySelectorAll("[data-way]")) {
    button.addEventListener("click", () => showWay(button.dataset.way));
  }
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => picture.look(button.dataset.view));
  }
  listen(byId("view"), byId("tip"));
}

function listen(canvas, tip) {
  const down = new Map();
  let apart = 0;
  const spread = () => { const [a, b] = [...down.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  const zoom = (by) => { picture.eye.scale *= by; picture.redraw(); };
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    down.set(e.pointerId, [e.clientX, e.clientY]);
    if (down.size === 2) apart = spread();
    point(e);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => down.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    const last = down.get(e.pointerId);
    if (!last) { point(e); return; }
    const [dx, dy] = [e.clientX - last[0], e.clientY - last[1]];
    down.set(e.pointerId, [e.clientX, e.clientY]);
    if (down.size === 2) {
      const now = spread();
      zoom(apart / Math.max(now, 1));
      apart = now;
      move(dx / 2, dy / 2);
    } else if (e.buttons & 2 || e.shiftKey) move(dx, dy);
    else turn(-0.008 * dx, 0.008 * dy);
    tip.hidden = true;
  });
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("dblclick", () => picture.look("reset"));
  /* The wheel scrolls the page, unless the picture was clicked before. */
  canvas.addEventListener("wheel", (e) => {
    if (document.activeElement !== canvas && !e.ctrlKey) return;
    e.preventDefault();
    zoom(Math.exp(0.0012 * e.deltaY));
  }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const keys = {
      ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
      "+": () => zoom(1 / 1.15), "-": () => zoom(1.15), 0: () => picture.look("reset"),
    };
    if (keys[e.key]) { e.preventDefault(); keys[e.key](); }
  });

  function turn(by, over) {
    const { eye } = picture;
    eye.turn += by;
    eye.tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, eye.tilt + over));
    picture.redraw();
  }
  function move(dx, dy) {
    const { eye } = picture, { right, up } = axesOf(eye);
    eye.middle = eye.middle.map((m, i) => m - eye.scale * (dx * right[i] - dy * up[i]));
    picture.redraw();
  }
  function point(e) {
    const box = canvas.getBoundingClientRect(), x = e.clientX - box.left, y = e.clientY - box.top;
    const i = picture.layers.readings ? picture.nearest(x, y) : -1;
    tip.hidden = i < 0;
    if (i < 0) return;
    tip.textContent = readingWords(i);
    tip.style.left = `${Math.max(4, Math.min(x + 14, box.width - tip.offsetWidth - 4))}px`;
    tip.style.top = `${Math.max(4, y - tip.offsetHeight - 10)}px`;
  }
}

function readingWords(i) {
  const { names, labels, words } = scene.readings, now = scene.hypotheses[picture.chosen];
  if (words) return words[i];
  const label = labels[i] ? `, ${labels[i]}` : "";
  if (!now) return `reading ${names[i]}${label}`;
  const verdict = now.wrong[i] ? "does not fit" : "fits";
  return `reading ${names[i]}${label}: ${now.off_mm[i].toPrecision(2)} mm from ${now.met[i]}, ${verdict}`;
}
