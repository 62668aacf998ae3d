// Gamepads: left stick in the plane of the picture, right stick up is away. They vibrate with the force.
import type { Deflection } from "./deflection";

const SHAKE_MS = 120;
// Some browsers offer a SpaceMouse as a gamepad, too. Its axes are not those of sticks.
const SPACE_MOUSE = /\b256f\b|\b046d\b.*\bc6[02][0-9a-f]\b/i;

type Actuator = { playEffect?: (kind: string, effect: object) => Promise<unknown> };

const pads = () => (navigator.getGamepads?.() ?? [])
  .filter((one): one is Gamepad => one !== null && one.connected && !SPACE_MOUSE.test(one.id));

export class Pad {
  private shaken = 0;

  read(): Deflection[] {
    return pads().map(({ axes: [x = 0, y = 0, , forth = 0], buttons }) => ({
      shift: [x, -y, -forth], turn: [0, 0, 0], pressed: buttons[0]?.pressed ?? false,
    }));
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
}
