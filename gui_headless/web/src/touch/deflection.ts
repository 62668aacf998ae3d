// Inputs whose deflection is a speed: a gamepad, a SpaceMouse. While a tool is held, they move it along the axes of the
// picture, and turn it about them. Without a deflection it rests: an input that is lost stops the tool where it is.
import type { Touch } from "./touch";
import type { View } from "../view";

export type Triple = [number, number, number];

/** Parts of the full deflection, -1 to 1, along and about right, up and away of the picture. */
export type Deflection = { shift: Triple; turn: Triple; pressed: boolean };

const DEAD = 0.12, FULL_TURN_RAD_S = 1;

/** Zero near the middle. A number beyond the range counts as its end, one that is not finite as none. */
function beyondTheMiddle(part: number): number {
  const size = Math.min(1, Math.abs(part));
  return size > DEAD ? (Math.sign(part) * (size - DEAD)) / (1 - DEAD) : 0;
}

export class Deflections {
  private pressed = false;

  /** `read`: the deflections of all inputs, now. */
  constructor(private readonly touch: Touch, private readonly view: View, private readonly read: () => Deflection[]) {
    // Frames are rare where nothing moves.
    setInterval(() => this.press(), 50);
  }

  move(passed_s: number): void {
    const way = 2 * this.view.size_m() * passed_s, angle = FULL_TURN_RAD_S * passed_s;
    for (const { shift, turn } of this.read()) {
      const [right, up, away] = shift.map(beyondTheMiddle), [aboutRight, aboutUp, aboutAway] = turn.map(beyondTheMiddle);
      this.touch.shift(right * way, up * way, away * way);
      this.touch.turn(aboutRight * angle, aboutUp * angle, aboutAway * angle);
    }
  }

  /** The first button takes the first free tool, or releases the held one. */
  private press(): void {
    const pressed = this.read().some((one) => one.pressed), begins = pressed && !this.pressed;
    this.pressed = pressed;
    if (!begins || document.hidden) return;
    const free = this.touch.tools.find((one) => one.holder === 0);
    if (this.touch.user >= 0) this.touch.release();
    else if (free) this.touch.take(free.user);
  }
}
