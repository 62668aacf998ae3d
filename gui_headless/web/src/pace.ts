// How much of the picture a machine can afford.

/** Pixels of the picture per pixel of the page, size of the shadow map (0: none), and frames from one map to the next. */
export type Tier = { ratio: number; shadow: number; every: number };

/** From a fast machine to a slow one. */
export const TIERS: readonly Tier[] = [
  { ratio: 2, shadow: 2048, every: 1 },
  { ratio: 1, shadow: 2048, every: 2 },
  { ratio: 1, shadow: 1024, every: 4 },
  { ratio: 0.75, shadow: 1024, every: 8 },
  { ratio: 0.75, shadow: 0, every: 1 },
  { ratio: 0.5, shadow: 0, every: 1 },
  { ratio: 0.4, shadow: 0, every: 1 },
];

const SLOW_MS = 34; // a frame that is slower than this costs too much
const FAST_MS = 20;
const SETTLED = 6; // frames, before a tier is judged
export const SOFTWARE_TIER = 4; // with which a machine without a graphics card begins
const RETRY_MS = 10_000; // of fast frames before a better tier is tried; doubles where that fails

export class Pace {
  private average_ms = FAST_MS;
  private frames = 0;
  private fast_ms = 0;
  private patience_ms = RETRY_MS;

  /** Begins with a tier. */
  constructor(public number: number) {}

  get tier(): Tier {
    return TIERS[this.number];
  }

  /** After a frame that was drawn, the time to the next one. Returns whether the tier has changed. */
  take(gap_ms: number): boolean {
    if (gap_ms > 5000) return false; // the page stood still
    this.average_ms += 0.25 * (gap_ms - this.average_ms);
    this.fast_ms = this.average_ms < FAST_MS ? this.fast_ms + gap_ms : 0;
    if (++this.frames < SETTLED) return false;
    if (this.average_ms > SLOW_MS && this.number < TIERS.length - 1) {
      if (this.frames < 100) this.patience_ms *= 2;
      return this.change(1);
    }
    return this.fast_ms > this.patience_ms && this.number > 0 && this.change(-1);
  }

  private change(by: number): true {
    this.number += by;
    this.average_ms = 0.5 * (FAST_MS + SLOW_MS);
    this.frames = this.fast_ms = 0;
    return true;
  }
}

export type Picture = { canvas: HTMLCanvasElement; context: WebGL2RenderingContext | null; software: boolean };

const DRAWN_BY = { alpha: false, powerPreference: "high-performance" } as const; // nothing is to be seen through a canvas

/**
 * The context of a canvas. `software`: the processor draws in the place of a graphics card. It needs up to a second for a
 * context, so it has one only, without smooth edges; a graphics card draws on a copy that takes the place of the canvas.
 */
export function pictureOn(canvas: HTMLCanvasElement): Picture {
  const context = canvas.getContext("webgl2", { ...DRAWN_BY, antialias: false });
  const details = context?.getExtension("WEBGL_debug_renderer_info");
  const name = String(context?.getParameter(details ? details.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  const software = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  if (!context || software) return { canvas, context, software };
  context.getExtension("WEBGL_lose_context")?.loseContext();
  const smooth = canvas.cloneNode() as HTMLCanvasElement;
  canvas.replaceWith(smooth);
  return { canvas: smooth, context: smooth.getContext("webgl2", { ...DRAWN_BY, antialias: true }), software };
}
