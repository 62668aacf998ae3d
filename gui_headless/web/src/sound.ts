// The force as a tone. Off until the user wants it: a browser plays nothing before a click.
const LOWEST_HZ = 110, OCTAVES = 3, LOUDEST = 0.2, FOLLOWS_S = 0.03;

export class Sound {
  private context?: AudioContext;
  private tone?: OscillatorNode;
  private volume?: GainNode;
  private on = false;

  /** Returns whether it is on now. */
  toggle(): boolean {
    this.on = !this.on;
    if (this.on && !this.context) {
      this.context = new AudioContext();
      this.volume = new GainNode(this.context, { gain: 0 });
      this.tone = new OscillatorNode(this.context, { type: "triangle", frequency: LOWEST_HZ });
      this.tone.connect(this.volume).connect(this.context.destination);
      this.tone.start();
    }
    if (this.on) void this.context?.resume();
    else this.play(0), void this.context?.suspend();
    return this.on;
  }

  /** `part`: the force, as part of the scale. */
  play(part: number): void {
    if (!this.context || !this.tone || !this.volume) return;
    const level = this.on ? Math.min(1, part) : 0, now = this.context.currentTime;
    this.volume.gain.setTargetAtTime(level > 0.005 ? LOUDEST * Math.sqrt(level) : 0, now, FOLLOWS_S);
    this.tone.frequency.setTargetAtTime(LOWEST_HZ * 2 ** (OCTAVES * level), now, FOLLOWS_S);
  }
}
