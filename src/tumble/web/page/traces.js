// Traces of the last seconds: a column each thirtieth of a second, from its least to its greatest sample.

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
  const end = columns[columns.length - 1].time, style = getComputedStyle(document.documentElement);
  const x = (time) => canvas.width * (1 - (end - time) / SECONDS), y = (value) => canvas.height * (1 - (value - low) / span);
  g.strokeStyle = style.getPropertyValue("--line"); g.lineWidth = 1;
  g.beginPath(); g.moveTo(0, y(0)); g.lineTo(canvas.width, y(0)); g.stroke();
  g.fillStyle = style.getPropertyValue("--soft"); g.font = `${11 * ratio}px system-ui`;
  g.fillText(most.toPrecision(3), 2, 12 * ratio); g.fillText(least.toPrecision(3), 2, canvas.height - 3);
  ["--x", "--y", "--z"].forEach((name, axis) => {
    g.strokeStyle = style.getPropertyValue(name); g.lineWidth = ratio * 1.3; g.beginPath();
    columns.forEach(({ time, values }, i) => {
      const a = y(values[first + 2 * axis]), b = y(values[first + 2 * axis + 1]), at = x(time);
      i ? g.lineTo(at, a) : g.moveTo(at, a); g.lineTo(at, b);
    });
    g.stroke();
  });
}
