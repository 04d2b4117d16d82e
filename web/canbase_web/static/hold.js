// Hold-to-drive and the large stop. Every way in which a finger, a page or a browser goes ends the orders:
// the server counts an order only while it echoes a number that is younger than 0.2 s.
window.canbaseHold = (() => {
  let socket = null, newest = 0, press = 0, forward = 0, turn = 0, held = false, share = 0.2;
  const keys = new Set();
  const KEYS = {ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1]};
  const say = text => { const e = document.getElementById("hold-state"); if (e && e.textContent !== text) e.textContent = text; };
  const send = () => {
    if (held && socket && socket.readyState === WebSocket.OPEN && newest)
      socket.send(JSON.stringify({press, number: newest, forward: forward * share, turn: turn * share}));
  };
  const release = () => {
    keys.clear();
    document.querySelectorAll("[data-hold]").forEach(e => e.classList.remove("held"));
    if (!held) return;
    held = false;
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({release: true}));
  };
  const hold = (f, t) => { if (!held) press += 1; forward = f; turn = t; held = true; send(); };
  const fromKeys = () => {
    if (!keys.size) return release();
    let f = 0, t = 0;
    keys.forEach(key => { f += KEYS[key][0]; t += KEYS[key][1]; });
    hold(Math.max(-1, Math.min(1, f)), Math.max(-1, Math.min(1, t)));
  };
  const lock = () => { release(); if (socket) { socket.onclose = null; socket.close(); } socket = null; newest = 0; say("locked"); };
  const unlock = ticket => {
    lock();
    socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/hold?ticket=${ticket}`);
    socket.onmessage = event => {
      const message = JSON.parse(event.data);
      newest = message.number;
      say(message.state);
      send();
    };
    socket.onclose = () => { release(); socket = null; newest = 0; say("not connected: lock and unlock the page"); };
  };
  for (const kind of ["blur", "pagehide", "freeze"]) addEventListener(kind, release);
  document.addEventListener("visibilitychange", () => { if (document.hidden) release(); });
  addEventListener("pointerdown", event => {
    const pad = event.target.closest && event.target.closest("[data-hold]");
    if (!pad || !socket) return;
    event.preventDefault();
    pad.setPointerCapture(event.pointerId);
    pad.classList.add("held");
    const [f, t] = pad.dataset.hold.split(",").map(Number);
    hold(f, t);
  });
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) addEventListener(kind, release);
  addEventListener("contextmenu", event => { if (event.target.closest && event.target.closest("[data-hold]")) event.preventDefault(); });
  addEventListener("keydown", event => {
    if (event.metaKey || event.ctrlKey || event.altKey) return release();  // a keyboard may keep the keyup of the others to itself (macOS)
    if (!(event.key in KEYS) || !socket || !document.querySelector("[data-hold]") || event.target.closest("input")) return;
    event.preventDefault();
    if (!event.repeat) { keys.add(event.key); fromKeys(); }
  });
  addEventListener("keyup", event => { if (keys.delete(event.key)) fromKeys(); });
  return {unlock, lock, setShare: value => { share = value; }};
})();
