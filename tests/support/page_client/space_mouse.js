// A SpaceMouse as WebHID shows it, in place of the browser's own devices: the page sees no difference. `spaceMouse` is
// what an operator and the browser's chooser do with it.
(() => {
  const PERIOD_MS = 8;
  const CONTROLLER = { usagePage: 1, usage: 8 };
  const device = (vendorId, productName, ...collections) => Object.assign(new EventTarget(), {
    vendorId, productName, productId: 0xc635, opened: false, refuses: false, collections,
    async open() {
      if (this.opened) throw new DOMException("The device is already open.", "InvalidStateError");
      if (this.refuses) throw new DOMException("Failed to open the device.", "NotAllowedError");
      this.opened = true;
    },
  });
  const cap = device(0x256f, "SpaceMouse Compact", CONTROLLER);
  const others = [device(0x256f, "CadMouse", { usagePage: 1, usage: 2 }), device(0x1234, "Pedals", CONTROLLER)];
  const matches = (one, filter) => one.vendorId === filter.vendorId
    && one.collections.some((two) => two.usagePage === filter.usagePage && two.usage === filter.usage);

  const hid = Object.assign(new EventTarget(), {
    async getDevices() {
      return sessionStorage.permitted ? [...others, cap] : [];
    },
    async requestDevice({ filters }) {
      if (!navigator.userActivation.isActive) throw new DOMException("Must be handling a user gesture.", "SecurityError");
      spaceMouse.filters = filters;
      if (!spaceMouse.choice) return [];
      sessionStorage.permitted = "yes";
      return [...others, cap].filter((one) => filters.some((filter) => matches(one, filter)));
    },
  });
  Object.defineProperty(Navigator.prototype, "hid", { get: () => hid });
  const pad = { id: "none", connected: true, axes: [0, 0, 0, 0], buttons: [] };
  Object.defineProperty(Navigator.prototype, "getGamepads", { value: () => [null, pad] });

  let timer = 0;
  const report = (reportId, bytes) => {
    if (!cap.opened) return;
    const buffer = new Uint8Array([0xff, 0x7f, 0xff, ...bytes]); // a view that does not begin with its buffer
    const event = Object.assign(new Event("inputreport"), { device: cap, reportId, data: new DataView(buffer.buffer, 3) });
    cap.dispatchEvent(event);
  };
  const ofShorts = (values) => [...new Uint8Array(Int16Array.from(values).buffer)];
  const spaceMouse = {
    filters: null, choice: false, cap, others, pad,
    /** The operator holds the cap so: a report of these numbers, again and again. */
    hold(reportId, values) {
      this.stopReports();
      timer = setInterval(() => report(reportId, ofShorts(values)), PERIOD_MS);
    },
    /** The cap is released: zeros once, then no reports. */
    centre() {
      this.stopReports();
      for (const reportId of [1, 2]) report(reportId, ofShorts([0, 0, 0, 0, 0, 0]));
    },
    stopReports: () => clearInterval(timer),
    bytes: (reportId, bytes) => report(reportId, bytes),
    press(buttons) {
      report(3, [buttons, 0]);
    },
    plug(type) {
      cap.opened = false;
      hid.dispatchEvent(Object.assign(new Event(type), { device: cap }));
    },
  };
  window.spaceMouse = spaceMouse;
})();
