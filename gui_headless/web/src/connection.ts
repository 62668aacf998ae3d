// The Foxglove WebSocket protocol, as far as the page uses it. Connects again by itself.
import { Decoder, parseSchema, type Value } from "./cdr";

export type Link = "connecting" | "live" | "frozen" | "lost" | "ended";

export interface Listener {
  /** A server that was not connected before: all that is known of the earlier one is void. */
  started(server: { name: string; version: string }): void;
  linked(link: Link, detail: string): void;
  received(topic: string, value: Value): void;
  refused(text: string): void;
}

const FROZEN_MS = 3500; // each program publishes its status once a second
const RETRY_MS = [500, 1000, 2000];
const tool = (user: number) => ({
  id: 2 + user, topic: `/user_${user}/tool`, encoding: "cdr", schemaName: "subworld::msg::ToolPose",
});
const CONTROL = { id: 1, topic: "/control", encoding: "cdr", schemaName: "subworld::msg::Control" };

export class Connection {
  bytes = 0;
  /** Of this connection, among those of the server. */
  number = 0;
  private socket?: WebSocket;
  private session = "";
  private tries = 0;
  private ended = false;
  private heard = 0;
  private watched = 0;
  private link: Link = "connecting";
  private channels = new Map<string, { id: number; decoder: Decoder }>();
  private topics = new Map<number, string>();
  private wanted = new Set<string>();
  private subscribed = new Set<string>();
  private offered = new Set<number>(); // users whose tools this page has offered to move

  constructor(private readonly address: string, private readonly listener: Listener) {
    setInterval(() => this.watch(), 500);
    this.connect();
  }

  /** Subscribes to these topics, and to no others. */
  want(topics: Iterable<string>): void {
    this.wanted = new Set(topics);
    this.subscribe();
  }

  /** A pose of the tool of a user (touch/touch.ts). */
  moveTool(user: number, cdr: Uint8Array): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN || !this.number) return false;
    if (!this.offered.has(user)) this.socket.send(JSON.stringify({ op: "advertise", channels: [tool(user)] }));
    this.offered.add(user);
    return this.publish(cdr, tool(user).id);
  }

  publish(cdr: Uint8Array, channel = CONTROL.id): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    const message = new Uint8Array(5 + cdr.length);
    message[0] = 1;
    new DataView(message.buffer).setUint32(1, channel, true);
    message.set(cdr, 5);
    this.socket.send(message);
    return true;
  }

  private connect(): void {
    const socket = new WebSocket(this.address, ["foxglove.sdk.v1", "foxglove.websocket.v1"]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      if (this.link !== "live") this.set("live", "");
      if (typeof event.data === "string") this.text(JSON.parse(event.data));
      else this.sample(event.data);
    };
    socket.onclose = (event) => this.closed(socket, event.code === 1001);
    this.socket = socket;
    this.subscribed.clear();
    this.offered.clear();
    this.number = 0;
    this.heard = performance.now();
  }

  private closed(socket: WebSocket, ended: boolean): void {
    if (socket !== this.socket) return;
    this.ended ||= ended;
    this.set(this.ended ? "ended" : "lost", "");
    setTimeout(() => this.connect(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
  }

  private watch(): void {
    // Where the page itself stood still, as in a tab in the background, its messages wait behind this timer.
    const now = performance.now(), late = now - this.watched > 1500;
    this.watched = now;
    if (late) this.heard = now;
    const silent_ms = performance.now() - this.heard;
    if (this.socket?.readyState !== WebSocket.OPEN || silent_ms < FROZEN_MS) return;
    this.set("frozen", `${Math.floor(silent_ms / 1000)} s`);
  }

  private set(link: Link, detail: string): void {
    this.link = link;
    this.listener.linked(link, detail);
  }

  private text(message: Value): void {
    if (message.op === "serverInfo") {
      this.tries = 0;
      this.ended = false;
      this.channels.clear();
      this.number = Number(message.metadata?.connection ?? 0);
      if (message.sessionId !== this.session) {
        this.session = message.sessionId;
        this.listener.started({ name: message.name, version: message.metadata?.subworld ?? "" });
      }
      if (message.capabilities?.includes("clientPublish"))
        this.socket?.send(JSON.stringify({ op: "advertise", channels: [CONTROL] }));
    } else if (message.op === "advertise") {
      for (const one of message.channels) {
        const root = one.schemaName.split("::").pop();
        this.channels.set(one.topic, { id: one.id, decoder: new Decoder(parseSchema(one.schema), root) });
        this.topics.set(one.id, one.topic);
      }
      this.subscribe();
    } else if (message.op === "status" && message.level >= 2) {
      this.listener.refused(message.message);
    }
  }

  private sample(data: ArrayBuffer): void {
    this.bytes += data.byteLength;
    const topic = this.topics.get(new DataView(data).getUint32(1, true)) ?? "";
    const channel = this.channels.get(topic);
    if (channel && this.wanted.has(topic)) this.listener.received(topic, channel.decoder.decode(data.slice(13)));
  }

  /** A subscription has the id of its channel. */
  private subscribe(): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    const begun = [...this.wanted].filter((topic) => this.channels.has(topic) && !this.subscribed.has(topic));
    const over = [...this.subscribed].filter((topic) => !this.wanted.has(topic));
    const id = (topic: string) => this.channels.get(topic)!.id;
    if (begun.length)
      this.socket.send(JSON.stringify({
        op: "subscribe", subscriptions: begun.map((topic) => ({ id: id(topic), channelId: id(topic) })),
      }));
    if (over.length) this.socket.send(JSON.stringify({ op: "unsubscribe", subscriptionIds: over.map(id) }));
    for (const topic of begun) this.subscribed.add(topic);
    for (const topic of over) this.subscribed.delete(topic);
  }
}
