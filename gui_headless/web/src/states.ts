// Poses and velocities of all bodies, and which of them move.
import type { Table } from "./cdr";

const SAME = 1e-9; // m, and of a quaternion's numbers
const SAME_TURN = 2e-4; // of a quaternion's numbers: no pixel of a body changes

/** Poses (position, then orientation x, y, z, w) and velocities of all bodies. */
export class States {
  readonly from: Float64Array;
  readonly to: Float64Array;
  readonly speed: Float64Array;
  /** The bodies whose pose the last `show` has written: the first `shownCount` of `shown`. */
  readonly shown: Uint32Array;
  shownCount = 0;
  /** Motion from the last place that is shorter cannot be seen, m. */
  unseen_m = 0;
  changed_ms = 0;
  interval_ms = 33;
  private readonly moving: Uint32Array; // bodies that are not yet shown where they are, the first `moves`
  private readonly isMoving: Uint8Array;
  private moves = 0;

  constructor(readonly count: number) {
    this.from = new Float64Array(7 * count);
    this.to = new Float64Array(7 * count);
    this.speed = new Float64Array(count);
    this.shown = new Uint32Array(count);
    this.moving = new Uint32Array(count);
    this.isMoving = new Uint8Array(count);
  }

  /** Motion is drawn from what is shown now to `placed`, for as long as the last interval took. */
  take(placed: Table, now_ms: number): void {
    const share = this.share(now_ms);
    for (let i = 0; i < this.moves; ++i) this.pose(this.moving[i], share, this.from);
    const gap = now_ms - this.changed_ms;
    this.interval_ms = Math.min(250, Math.max(16, 0.7 * this.interval_ms + 0.3 * gap));
    this.changed_ms = now_ms;
    const { to, moving, isMoving } = this, { count, stride, numbers, words } = placed;
    for (let i = 0; i < count; ++i) {
      const id = words[i], from = i * stride, at = 7 * id;
      if (id >= this.count) continue;
      const x = numbers[from + 3], y = numbers[from + 4], z = numbers[from + 5];
      const way = Math.max(Math.abs(to[at] - numbers[from]), Math.abs(to[at + 1] - numbers[from + 1]),
        Math.abs(to[at + 2] - numbers[from + 2]));
      const turn = Math.max(Math.abs(to[at + 3] - x), Math.abs(to[at + 4] - y), Math.abs(to[at + 5] - z));
      this.speed[id] = numbers[from + 6];
      if (way <= this.unseen_m && turn <= SAME_TURN) continue;
      if (!isMoving[id]) {
        isMoving[id] = 1;
        moving[this.moves++] = id;
        for (let k = at; k < at + 7; ++k) this.from[k] = to[k];
      }
      for (let k = 0; k < 3; ++k) to[at + k] = numbers[from + k];
      to[at + 3] = x;
      to[at + 4] = y;
      to[at + 5] = z;
      to[at + 6] = Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z));
    }
  }

  /** States as the scene has them: position, orientation w, x, y, z, velocities. */
  reset({ count, stride, numbers, words }: Table): void {
    for (let i = 0; i < count; ++i) {
      const id = words[i], from = i * stride, at = 7 * id;
      if (id >= this.count) continue;
      for (let k = 0; k < 3; ++k) {
        this.to[at + k] = numbers[from + k];
        this.to[at + 3 + k] = numbers[from + 4 + k];
      }
      this.to[at + 6] = numbers[from + 3];
      this.speed[id] = Math.hypot(numbers[from + 7], numbers[from + 8], numbers[from + 9]);
    }
    this.from.set(this.to);
    this.isMoving.fill(0);
    this.moves = 0;
  }

  /** Whether the picture still moves. */
  changing(now_ms: number): boolean {
    return this.moves > 0 || now_ms - this.changed_ms < this.interval_ms + 50;
  }

  /** How much of the way the bodies have made. */
  private share(now_ms: number): number {
    return Math.min(1, (now_ms - this.changed_ms) / this.interval_ms);
  }

  /** Writes the poses of the bodies that are elsewhere than when last shown. */
  show(into: Float64Array, now_ms: number): void {
    const { to, moving, isMoving, shown } = this, share = this.share(now_ms), moves = this.moves;
    this.shownCount = moves;
    this.moves = 0;
    for (let i = 0; i < moves; ++i) {
      const id = (shown[i] = moving[i]), at = 7 * id;
      this.pose(id, share, into);
      let gap = 0;
      for (let k = at; k < at + 7; ++k) gap = Math.max(gap, Math.abs(into[k] - to[k]));
      if (gap > SAME) moving[this.moves++] = id;
      else isMoving[id] = 0;
    }
  }

  /** Writes the pose of a body. */
  private pose(id: number, share: number, into: Float64Array): void {
    const { from, to } = this, at = 7 * id;
    if (share >= 1) {
      for (let k = at; k < at + 7; ++k) into[k] = to[k];
      return;
    }
    for (let k = at; k < at + 3; ++k) into[k] = from[k] + share * (to[k] - from[k]);
    const dot = from[at + 3] * to[at + 3] + from[at + 4] * to[at + 4] + from[at + 5] * to[at + 5] + from[at + 6] * to[at + 6];
    const old = dot < 0 ? share - 1 : 1 - share;
    const x = old * from[at + 3] + share * to[at + 3], y = old * from[at + 4] + share * to[at + 4];
    const z = old * from[at + 5] + share * to[at + 5], w = old * from[at + 6] + share * to[at + 6];
    const scale = 1 / Math.sqrt(x * x + y * y + z * z + w * w || 1);
    into[at + 3] = x * scale;
    into[at + 4] = y * scale;
    into[at + 5] = z * scale;
    into[at + 6] = w * scale;
  }
}
