// Traces of the last seconds: a column each thirtieth of a second, from its least to its greatest sample.

import { colour } from "./solid.js";

const SECONDS = 20, BYTES = 8 + 12 * 4;
const columns = [];

export function take(buffer) {
  const view = new DataView(buffer);
  for (let at = 0; at + BYTES <= buffer.byteLength; at += BYTES) {
    const values = new Float32Array(12);
    for (let k = 0; k < 12; k++) values[k] = view.getFloat32(at + 8 + 4 * k, true);
    columns.push({ time: view.getFloat64(at, true), values });
  }
  const oldest = columns.length ? columns[columns.length - 1].time - SECONDS : 0;
  while (columns.length && columns[0].time < oldest) columns.shift();
}

export function draw(canvas, first) {
  const ratio = window.devicePixelRatio || 1, wide = canvas.clientWidth * ratio, high = canvas.clientHeight * ratio;
  if (canvas.width !== Math.round(wide) || canvas.height !== Math.round(high)) { canvas.width = Math.round(wide); canvas.height = Math.round(high); }
  const g = canvas.getContext("2d");
  g.clearRect(0, 0, canvas.width, canvas.height);
  if (!columns.length) return;
  let least = Infinity, most = -Infinity;
  for (const { values } of columns) for (let k = first; k < first + 6; k += 2) { if (values[k] < least) least = values[k]; if (values[k + 1] > most) most = values[k + 1]; }
  if (!Number.isFinite(least)) { g.fillText("none", 10, 20); return; }
  const pad = 0.08 * (most - least) || 1, low = least - pad, span = most - least + 2 * pad;
  const end = columns[columns.length - 1].time;
  const x = (time) => canvas.width * (1 - (end - time) / SECONDS), y = (value) => canvas.height * (1 - (value - low) / span);
  g.strokeStyle = colour("--line"); g.lineWidth = 1;
  g.beginPath(); g.moveTo(0, y(0)); g.lineTo(canvas.width, y(0)); g.stroke();
  g.fillStyle = colour("--soft"); g.font = `${11 * ratio}px system-ui`;
  g.fillText(most.toPrecision(3), 2, 12 * ratio); g.fillText(least.toPrecision(3), 2, canvas.height - 3);
  ["--x", "--y", "--z"].forEach((name, axis) => {
    // Bars on whole pixels, each up to the one before: a stroked path costs several times as much.
    const thick = Math.ceil(ratio * 1.3);
    let before = -1, lower = 0, upper = 0;
    g.fillStyle = colour(name);
    for (const { time, values } of columns) {
      const at = Math.round(x(time)), down = Math.round(y(values[first + 2 * axis])), up = Math.round(y(values[first + 2 * axis + 1]));
      const top = before < 0 ? up : Math.min(up, lower), bottom = before < 0 ? down : Math.max(down, upper);
      g.fillRect(before < 0 ? at : before, top, Math.max(at - before, 1), bottom - top + thick);
      before = at; lower = down; upper = up;
    }
  });
}
