// Keyboard, gamepad and buttons -> command (V [rpm], theta [deg], VC [rpm]), sent once a command period.

const AHEAD = { KeyW: 1, ArrowUp: 1, KeyS: -1, ArrowDown: -1 };
const LEFT = { KeyA: 1, ArrowLeft: 1, KeyD: -1, ArrowRight: -1 };
const TURN = { KeyQ: 1, KeyE: -1 };
const DEAD_ZONE = 0.15; // of a stick
const byId = (id) => document.getElementById(id);

export class Driver {
  constructor(send, hello) {
    this.send = send;
    this.held = new Map(); // what holds a key down -> codes of keys
    this.driving = false;
    for (const id of ["speed", "turning"]) {
      byId(id).max = hello.fastest_rpm;
      byId(id).value = Math.round(hello.fastest_rpm * (id === "speed" ? 0.6 : 0.3));
    }
    addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    // A key that is let go while another window has the keyboard is never reported.
    addEventListener("blur", () => this.stop());
    document.addEventListener("visibilitychange", () => this.stop());
    for (const button of document.querySelectorAll("#pad [data-keys]")) this.button(button);
    byId("stop").addEventListener("click", () => this.stop());
    byId("reset").addEventListener("click", () => this.reset());
    setInterval(() => this.tick(), 1000 * hello.period_s);
  }

  key(event, down) {
    const { code } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
    if (event.target.type === "range" && code.startsWith("Arrow")) return;
    if (code === "Space" || (down && code === "KeyR")) {
      // A button that has the focus is not pressed as well.
      event.preventDefault();
      if (down && code === "Space") this.stop();
      else if (down) this.reset();
    } else if (code in AHEAD || code in LEFT || code in TURN) {
      event.preventDefault();
      if (down) this.held.set(code, [code]);
      else this.held.delete(code);
      if (!event.repeat) this.tick();
    }
  }

  button(button) {
    const release = () => { this.held.delete(button); button.classList.remove("held"); this.tick(); };
    button.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      button.setPointerCapture(event.pointerId);
      this.held.set(button, button.dataset.keys.split(" "));
      button.classList.add("held");
      this.tick();
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, release);
  }

  stop() {
    this.held.clear();
    for (const button of document.querySelectorAll("#pad .held")) button.classList.remove("held");
    this.tick();
  }

  reset() {
    this.stop();
    this.send({ type: "reset" });
  }

  // Shares -1 .. 1 ahead, left, turn that keys and gamepad ask for.
  wanted() {
    const codes = new Set([...this.held.values()].flat());
    const share = (keys) => Math.sign([...codes].reduce((sum, code) => sum + (keys[code] ?? 0), 0));
    let [ahead, left, turn] = [share(AHEAD), share(LEFT), share(TURN)];
    const size = Math.hypot(ahead, left);
    if (size > 1) [ahead, left] = [ahead / size, left / size];
    for (const pad of navigator.getGamepads?.() ?? []) {
      if (!pad?.connected) continue;
      const axis = (i) => (Math.abs(pad.axes[i] ?? 0) > DEAD_ZONE ? pad.axes[i] : 0);
      if (axis(0) || axis(1)) [ahead, left] = [-axis(1), -axis(0)];
      if (axis(2)) turn = -axis(2);
    }
    return [ahead, left, turn];
  }

  tick() {
    const [ahead, left, turn] = this.wanted();
    for (const id of ["speed", "turning"]) byId(`${id}_shown`).textContent = `${byId(id).value} rpm`;
    const driving = Boolean(ahead || left || turn);
    // Pages that nobody drives from are silent, so that several can be open.
    if (!driving && !this.driving) return;
    this.driving = driving;
    const theta = ahead || left ? (Math.atan2(left, ahead) * 180) / Math.PI : 0;
    this.send({
      type: "drive",
      v: Math.min(1, Math.hypot(ahead, left)) * byId("speed").value,
      theta,
      vc: turn * byId("turning").value,
    });
  }
}
