// The unit as a box with gravity downwards, and the sphere of directions that can point up in it.

// Asking the style costs more than drawing: each colour is asked for once, until it is said that they are others.
let colours = {};
export const recolour = () => { colours = {}; };
export const colour = (name) => (colours[name] ??= getComputedStyle(document.documentElement).getPropertyValue(name).trim());
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((v) => v * s);
export const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

// Rows are the screen's right, up and towards the viewer, in the unit's axes; `up` points up on the screen.
function stood(up) {
  const helper = Math.abs(up[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const right = unit(cross(helper, up));
  return [right, up, cross(right, up)];
}
function seen(rows, lean, turn) {
  const [r, u, f] = rows, c = Math.cos(turn), s = Math.sin(turn), cl = Math.cos(lean), sl = Math.sin(lean);
  const r2 = r.map((v, i) => c * v + s * f[i]), f2 = f.map((v, i) => c * v - s * r[i]);
  return [r2, u.map((v, i) => cl * v - sl * f2[i]), f2.map((v, i) => cl * v + sl * u[i])];
}

const SIZE = [1.0, 0.7, 0.4]; // half edges: unlike, so that a face is known by its shape
const FACES = [0, 1, 2].flatMap((axis) => [1, -1].map((sign) => ({ axis, sign })));

export function drawBox(canvas, up) {
  const g = canvas.getContext("2d"), w = canvas.width, h = canvas.height;
  g.clearRect(0, 0, w, h);
  if (!up) return;
  const view = seen(stood(up), 0.45, 0.6), scale = Math.min(w, h) * 0.34;
  const flat = (p) => [w / 2 + scale * dot(view[0], p), h / 2 - scale * dot(view[1], p)];
  const names = ["x", "y", "z"], tints = ["--x", "--y", "--z"].map(colour);
  for (const { axis, sign } of FACES) {
    const normal = [0, 0, 0]; normal[axis] = sign;
    const facing = dot(view[2], normal);
    if (facing <= 0.001) continue;
    const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
    const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([p, q]) => {
      const at = [0, 0, 0]; at[axis] = sign * SIZE[axis]; at[b] = p * SIZE[b]; at[c] = q * SIZE[c]; return flat(at);
    });
    g.beginPath(); corners.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y))); g.closePath();
    g.fillStyle = colour("--card"); g.fill();
    g.globalAlpha = 0.15 + 0.5 * facing; g.fillStyle = tints[axis]; g.fill(); g.globalAlpha = 1;
    g.strokeStyle = colour("--ink"); g.lineWidth = 1.2; g.stroke();
    const at = [0, 0, 0]; at[axis] = sign * SIZE[axis];
    const [x, y] = flat(at);
    g.fillStyle = colour("--ink"); g.font = "600 16px system-ui"; g.textAlign = "center"; g.textBaseline = "middle";
    if (facing > 0.2) g.fillText((sign > 0 ? "+" : "−") + names[axis], x, y);
  }
  g.strokeStyle = g.fillStyle = colour("--soft"); g.beginPath(); g.moveTo(14, h - 12); g.lineTo(14, h - 44); g.stroke();
  g.beginPath(); g.moveTo(14, h - 50); g.lineTo(10, h - 42); g.lineTo(18, h - 42); g.fill();
  g.font = "11px system-ui"; g.textAlign = "left"; g.fillText("up", 22, h - 44);
}

const DIRECTIONS = [];
for (const x of [-1, 0, 1]) for (const y of [-1, 0, 1]) for (const z of [-1, 0, 1]) if (x || y || z) DIRECTIONS.push(unit([x, y, z]));

// Turned so that the present direction and the next are both in front: nothing that is wanted is behind the sphere.
export function drawSphere(canvas, held, up, next) {
  const g = canvas.getContext("2d"), w = canvas.width, h = canvas.height, R = Math.min(w, h) * 0.43;
  g.clearRect(0, 0, w, h);
  const middle = up && next ? up.map((v, i) => v + next[i]) : up || next || [0.3, 0.2, 1];
  const front = unit(Math.hypot(...middle) > 0.1 ? middle : up);
  const [right, , above] = stood(front), rows = [right, scaled(above, -1), front];
  const flat = (p) => [w / 2 + R * dot(rows[0], p), h / 2 - R * dot(rows[1], p), dot(rows[2], p)];
  g.strokeStyle = colour("--line"); g.lineWidth = 1; g.beginPath(); g.arc(w / 2, h / 2, R, 0, 7); g.stroke();
  const near = DIRECTIONS.map((d) => held.some((one) => dot(one, d) > 0.92));
  DIRECTIONS.map((d, i) => ({ at: flat(d), done: near[i], d })).sort((a, b) => a.at[2] - b.at[2]).forEach(({ at, done, d }) => {
    g.globalAlpha = at[2] > 0 ? 1 : 0.25;
    g.beginPath(); g.arc(at[0], at[1], 6, 0, 7);
    g.fillStyle = g.strokeStyle = done ? colour("--good") : colour("--soft");
    if (done) g.fill(); else g.stroke();
    const faces = d.filter((v) => Math.abs(v) > 0.9);
    if (faces.length && at[2] > 0) {
      const axis = d.findIndex((v) => Math.abs(v) > 0.9);
      g.fillStyle = colour("--ink"); g.font = "12px system-ui"; g.textAlign = "center"; g.textBaseline = "alphabetic";
      g.fillText((d[axis] > 0 ? "+" : "−") + "xyz"[axis], at[0], at[1] - 10);
    }
  });
  g.globalAlpha = 1;
  for (const one of held) { const [x, y, z] = flat(one); g.globalAlpha = z > 0 ? 1 : 0.3; g.fillStyle = colour("--good"); g.beginPath(); g.arc(x, y, 2.5, 0, 7); g.fill(); }
  g.globalAlpha = 1;
  if (next) { const [x, y] = flat(next); g.strokeStyle = colour("--next"); g.lineWidth = 3; g.beginPath(); g.arc(x, y, 11, 0, 7); g.stroke(); g.beginPath(); g.arc(x, y, 4, 0, 7); g.stroke(); }
  if (up) { const [x, y] = flat(up); g.strokeStyle = colour("--z"); g.lineWidth = 3; g.beginPath(); g.moveTo(x - 9, y); g.lineTo(x + 9, y); g.moveTo(x, y - 9); g.lineTo(x, y + 9); g.stroke(); }
  if (up && next && dot(up, next) < 0.97) { // the way from here to there
    g.strokeStyle = colour("--next"); g.lineWidth = 1.5; g.setLineDash([4, 4]); g.beginPath();
    for (let k = 0; k <= 20; k++) { const [x, y] = flat(unit(up.map((v, i) => v * (1 - k / 20) + next[i] * (k / 20) + 1e-4 * right[i]))); k ? g.lineTo(x, y) : g.moveTo(x, y); }
    g.stroke(); g.setLineDash([]);
  }
}
