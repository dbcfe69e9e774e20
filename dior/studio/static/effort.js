// Tells the server how long somebody was at a page, so that nobody has to note it. Who has not touched the page for half
// a minute is not at it.

const [EVERY_MS, AWAY_MS] = [30_000, 30_000];
let [touched, counted, seconds] = [performance.now(), performance.now(), 0];

function count() {
  const now = performance.now();
  if (!document.hidden) seconds += Math.max(0, Math.min(now, touched + AWAY_MS) - counted) / 1000;
  counted = now;
}

function tell() {
  count();
  if (seconds < 1) return;
  navigator.sendBeacon("/api/effort", JSON.stringify({ page: location.pathname, seconds: Math.min(seconds, 60) }));
  seconds = 0;
}

for (const kind of ["pointerdown", "pointermove", "wheel", "keydown"]) {
  document.addEventListener(kind, () => { count(); touched = performance.now(); }, { passive: true });
}
document.addEventListener("visibilitychange", () => (document.hidden ? tell() : count()));
setInterval(tell, EVERY_MS);
