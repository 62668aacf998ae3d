// A SpaceMouse by WebHID, which Chromium has on pages of this machine and of https. The user chooses the device once;
// the browser remembers it.
//
// | report | contents |
// |---|---|
// | 1 | x, y, z: 16 bits each, signed, little-endian, about 350 at the end of the range; newer models add rx, ry, rz |
// | 2 | rx, ry, rz of older models |
// | 3 | buttons, one bit each |
//
// x is right, y toward the operator, z down, and the turns about them are right-handed. While the cap is deflected, the
// device repeats its reports, 60 to 125 times a second.
import type { Deflection, Triple } from "./deflection";

type Report = Event & { reportId: number; data: DataView };
type Device = EventTarget & {
  vendorId: number; productName: string; opened: boolean; collections: { usagePage: number; usage: number }[];
  open(): Promise<void>;
};
type Kind = { vendorId: number; usagePage: number; usage: number };
type Hid = EventTarget & { getDevices(): Promise<Device[]>; requestDevice(options: { filters: Kind[] }): Promise<Device[]> };

/** Of 3Dconnexion, and of Logitech for older models; a multi-axis controller. */
const KINDS: Kind[] = [0x256f, 0x046d].map((vendorId) => ({ vendorId, usagePage: 1, usage: 8 }));
const FULL = 350;
const QUIET_MS = 500; // without a report: its radio link is lost
const BYTES = 6; // of three axes

const nameOf = (device: Device) => device.productName || "The SpaceMouse";
const isOne = ({ vendorId, collections }: Device) => KINDS.some((kind) => kind.vendorId === vendorId
  && collections.some(({ usagePage, usage }) => usagePage === kind.usagePage && usage === kind.usage));

/** What one device has reported. */
class Cap {
  private readonly axes = [0, 0, 0, 0, 0, 0];
  private pressed = false;
  private heard = 0;

  /** Of the device. Ignores reports of other kinds, and those that are too short. */
  readonly hear = (event: Event): void => {
    const { reportId: id, data } = event as Report;
    if (id === 3 && data.byteLength > 0) this.pressed = (data.getUint8(0) & 1) !== 0;
    if ((id !== 1 && id !== 2) || data.byteLength < BYTES) return;
    const first = id === 1 ? 0 : 3, count = id === 1 && data.byteLength >= 2 * BYTES ? 6 : 3;
    for (let i = 0; i < count; ++i) this.axes[first + i] = data.getInt16(2 * i, true) / FULL;
    this.heard = performance.now();
  };

  deflection(now: number): Deflection {
    if (now - this.heard > QUIET_MS) this.axes.fill(0);
    const [x, y, z, rx, ry, rz] = this.axes;
    // y and z point to the operator and down.
    const inThePicture = (right: number, near: number, down: number): Triple => [right, -down, -near];
    return { shift: inThePicture(x, y, z), turn: inThePicture(rx, ry, rz), pressed: this.pressed };
  }
}

export class SpaceMouse {
  private readonly hid = (navigator as unknown as { hid?: Hid }).hid;
  private readonly caps = new Map<Device, Cap>();
  /** What has happened, for the user. */
  said = "";

  /** `changed`: `wanted` or `said` may have. */
  constructor(private readonly changed: () => void) {
    const of = (event: Event) => (event as Event & { device: Device }).device;
    this.hid?.addEventListener("connect", (event) => this.open([of(event)]));
    this.hid?.addEventListener("disconnect", (event) => this.lose(of(event)));
    this.hid?.getDevices().then((devices) => this.open(devices)).catch(() => undefined); // not permitted here
  }

  /** Whether the user can choose one. */
  get wanted(): boolean {
    return this.hid !== undefined && this.caps.size === 0;
  }

  /** On a press of a button only: the browser asks the user. */
  async ask(): Promise<void> {
    try {
      const chosen = await this.hid!.requestDevice({ filters: KINDS });
      if (chosen.length === 0) this.say("No SpaceMouse was chosen.");
      await this.open(chosen);
    } catch (error) {
      this.say(`The browser offers no SpaceMouse: ${(error as Error).message}`);
    }
  }

  read(): Deflection[] {
    const now = performance.now();
    return [...this.caps.values()].map((cap) => cap.deflection(now));
  }

  private async open(devices: Device[]): Promise<void> {
    for (const device of devices.filter((one) => isOne(one) && !this.caps.has(one))) {
      const cap = new Cap(), name = nameOf(device);
      this.caps.set(device, cap);
      try {
        if (!device.opened) await device.open();
        device.addEventListener("inputreport", cap.hear);
        this.say(`${name} moves the tool.`);
      } catch (error) {
        this.caps.delete(device);
        this.say(`${name} cannot be opened: ${(error as Error).message} On Linux, its /dev/hidraw needs rights to read and write.`);
      }
    }
  }

  private lose(device: Device): void {
    const cap = this.caps.get(device);
    if (!cap) return;
    device.removeEventListener("inputreport", cap.hear);
    this.caps.delete(device);
    this.say(`${nameOf(device)} was unplugged.`);
  }

  private say(text: string): void {
    this.said = text;
    this.changed();
  }
}
