// The page of a guided capture: what comes over the socket, shown; what the person asks, sent.
import { drawBox, drawSphere, recolour } from "./solid.js";
import { take, draw } from "./traces.js";

const $ = (id) => document.getElementById(id);
const refused = [];
let socket, state = {}, next = null, leads = false, over = false, ended = 0, sound = false, audio, frames = 0, fresh = true, turned = true;

function connect() {
  socket = new WebSocket(`ws://${location.host}/watch${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { said.replaceChildren(); refused.length = 0; show("link", "watching"); $("link").className = ""; };
  socket.onmessage = ({ data }) => {
    if (data instanceof ArrayBuffer) { fresh = true; return take(data); }
    turned = true;
    const message = JSON.parse(data);
    if (message.state) { state = message.state; table(); holds(); now(); }
    if (message.event) event(message.event);
    if ("leads" in message) { leads = message.leads; show("link", leads ? "you lead" : "watching; another viewer leads"); buttons(); }
  };
  socket.onclose = () => {
    if (over) return show("link", "the capture has ended");
    $("link").className = "lost"; show("link", "no connection to tumble: trying again");
    setTimeout(connect, 1000);
  };
}
const said = $("said");
const show = (id, words) => { if ($(id).textContent !== words) $(id).textContent = words; };
const ask = (wish) => leads && socket.readyState === 1 && socket.send(JSON.stringify(wish));

const TONES = { hold_accepted: [660], hold_complete: [880], hold_refused: [220, 220], enough: [660, 880, 1100], silence: [180], back: [500] };
function beep(kind) {
  if (!sound || !TONES[kind]) return;
  TONES[kind].forEach((pitch, k) => {
    const tone = audio.createOscillator(), loud = audio.createGain(), at = audio.currentTime + 0.18 * k;
    tone.frequency.value = pitch; loud.gain.setValueAtTime(0.15, at); loud.gain.exponentialRampToValueAtTime(0.001, at + 0.16);
    tone.connect(loud).connect(audio.destination); tone.start(at); tone.stop(at + 0.17);
  });
}

function event(one) {
  const line = document.createElement("li"), time = document.createElement("time");
  line.className = one.event; time.textContent = `${one.t.toFixed(1)} s `;
  line.append(time, one.words);
  if (one.event !== "sigma") said.prepend(line);
  while (said.childElementCount > 200) said.lastChild.remove();
  beep(one.event);
  if (one.event === "next_pose") { next = one; show("next", one.words); show("next-caption", one.turn_axis ? `Next: turn from here, ${one.pose ?? ""}` : one.pose ? `Next: ${one.pose}` : "Next: as it lies"); }
  if (one.event === "hold_refused") { refused.push(one); headline(one.words, "bad"); }
  if (one.event === "silence") headline(one.words, "bad");
  if (one.event === "back") until = 0;
  if (one.event === "enough") headline("It is enough. " + one.words, "good");
  if (["calibrated", "not_calibrated", "characterised"].includes(one.event)) finish(one);
  holds();
}
let until = 0;
function headline(words, kind, seconds = 4) { show("now", words); $("now").className = kind; until = performance.now() + 1000 * seconds; }
function finish(one) {
  over = true; buttons();
  headline(one.event === "characterised" ? "The noise is characterised." : one.words, one.fit || one.event === "characterised" ? "good" : "bad", 1e6);
  if (one.event !== "not_calibrated") {
    const link = document.createElement("a");
    link.href = "/report" + location.search; link.textContent = "Open the report";
    $("next").replaceChildren(link);
  }
}
function now() {
  const still = state.stillness, rest = state.resting;
  if (still !== null && still !== undefined) { $("still").value = Math.min(still, 2); show("still-words", still < 1 ? `still (${still.toFixed(2)})` : `moving (${still.toFixed(1)})`); }
  const wanted = state.hold_seconds ?? Infinity;
  $("held").max = state.hold_seconds ?? 1; $("held").value = rest ? Math.min(rest.seconds, $("held").max) : 0;
  show("held-words", rest ? `${rest.seconds.toFixed(1)}${wanted < Infinity ? ` of ${wanted}` : ""} s` : "");
  const [force, rate] = state.units.map((one) => (one ?? "none").replace("^2", "²").replace("deg", "°"));
  show("force-unit", `(${force})`); show("rate-unit", `(${rate})`);
  if (performance.now() < until || over) return;
  $("now").className = rest && rest.seconds >= wanted ? "good" : "";
  show("now", rest ? (rest.seconds >= wanted ? "Long enough: turn to the next pose." : `Hold ${rest.hold}: keep it still.`) : still < 1 ? "Keep it still." : "Turn, then keep it still.");
}
let tabled = "";
function table() {
  const key = JSON.stringify(state.groups ?? []);
  if (key === tabled) return;
  tabled = key;
  $("groups").replaceChildren(...(state.groups ?? []).map((row) => {
    const line = document.createElement("tr");
    const cells = [row.group, row.sigma, row.target, !row.target ? "" : row.reached ? "✓" : "…"];
    cells.forEach((words) => { const cell = document.createElement("td"); cell.textContent = words; line.append(cell); });
    line.lastChild.className = row.reached ? "reached" : "open"; line.lastChild.title = !row.target ? "" : row.reached ? "reached" : "not yet";
    return line;
  }));
}
let shown = "";
function holds() {
  const list = state.holds ?? [], key = JSON.stringify([list, refused.length, leads, over]);
  if (key === shown) return;
  shown = key;
  show("count", list.length ? `(${list.length})` : "");
  const lines = list.map((hold) => {
    const line = document.createElement("li"), words = document.createElement("span"), note = document.createElement("small"), drop = document.createElement("button");
    words.append(`${hold.hold}. ${hold.pose} · ${hold.seconds} s `); note.textContent = hold.note; words.append(note);
    drop.type = "button"; drop.textContent = "Drop"; drop.disabled = !leads || over; drop.setAttribute("aria-label", `Drop hold ${hold.hold}`);
    drop.onclick = () => { drop.disabled = true; ask({ do: "drop", hold: hold.hold }); };
    line.append(words, drop);
    return line;
  });
  const bad = refused.slice(-5).map((one) => { const line = document.createElement("li"); line.className = "refused"; line.textContent = `✗ ${one.start.toFixed(1)} s: ${one.reason}`; return line; });
  $("holds").replaceChildren(...bad.reverse(), ...lines.reverse());
}
function buttons() { $("stop").disabled = !leads || over; holds(); }

$("stop").onclick = () => { ask({ do: "stop" }); headline("Calibrating …", "", 60); };
$("theme").onclick = () => {
  const root = document.documentElement, dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark"; repaint();
};
const repaint = () => { recolour(); fresh = turned = true; };
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
addEventListener("resize", repaint);
$("sound").onclick = () => {
  sound = !sound; audio ??= new AudioContext(); audio.resume();
  $("sound").textContent = sound ? "Sound on" : "Sound off"; $("sound").setAttribute("aria-pressed", sound); beep("hold_complete");
};
document.addEventListener("keydown", (key) => {
  if (key.ctrlKey || key.metaKey || key.altKey) return;
  const button = { m: "sound", d: "theme", e: "stop" }[key.key];
  if (button && !$(button).disabled) $(button).click();
});

let counted = performance.now();
function frame(at) {
  if (fresh) {
    fresh = false; frames++;
    draw($("force"), 0); draw($("rate"), 6);
  }
  if (turned) {
    turned = false;
    drawBox($("box-now"), state.up); drawBox($("box-next"), next && next.up);
    drawSphere($("sphere"), (state.holds ?? []).map((hold) => hold.up).filter(Boolean), state.up, next && next.up);
  }
  if (at - counted > 1000) { show("frames", `${(frames * 1000 / (at - counted)).toFixed(0)} frames a second`); frames = 0; counted = at; }
  requestAnimationFrame(frame);
}
connect();
requestAnimationFrame(frame);
