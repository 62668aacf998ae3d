// A gamepad moves the held tool: left stick in the plane of the picture, right stick up is away. It vibrates with the
// force.
import type { Touch } from "./touch";
import type { View } from "./view";

const DEAD = 0.12, SHAKE_MS = 120;

type Actuator = { playEffect?: (kind: string, effect: object) => Promise<unknown> };

const pads = () => (navigator.getGamepads?.() ?? []).filter((one): one is Gamepad => one !== null && one.connected);

/** -1 to 1, zero near the middle. */
function axis(value = 0): number {
  return Math.abs(value) < DEAD ? 0 : (value - Math.sign(value) * DEAD) / (1 - DEAD);
}

export class Pad {
  private shaken = 0;
  private pressed = false;

  constructor(private readonly touch: Touch, private readonly view: View) {
    // The first button takes the first free tool, or releases the held one. Frames are rare where nothing moves.
    setInterval(() => this.press(), 50);
  }

  move(passed_s: number): void {
    const step = 2 * this.view.size_m() * passed_s;
    for (const { axes } of pads()) this.touch.shift(axis(axes[0]) * step, -axis(axes[1]) * step, -axis(axes[3]) * step);
  }

  /** `part`: the force, as part of the scale. */
  shake(part: number): void {
    const now = performance.now();
    if (part < 0.02 || now - this.shaken < 0.6 * SHAKE_MS) return;
    this.shaken = now;
    for (const pad of pads()) {
      const actuator = (pad as unknown as { vibrationActuator?: Actuator }).vibrationActuator;
      const level = Math.min(1, part);
      actuator?.playEffect?.("dual-rumble", { duration: SHAKE_MS, strongMagnitude: level, weakMagnitude: 0.5 * level })
        .catch(() => undefined); // a pad without motors
    }
  }

  private press(): void {
    const pressed = pads().some((pad) => pad.buttons[0]?.pressed), begins = pressed && !this.pressed;
    this.pressed = pressed;
    if (!begins || document.hidden) return;
    const free = this.touch.tools.find((one) => one.holder === 0);
    if (this.touch.user >= 0) this.touch.release();
    else if (free) this.touch.take(free.user);
  }
}
