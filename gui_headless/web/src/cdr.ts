// Reads the schemas of the server (OMG IDL without arrays) and plain CDR of little-endian machines.

type Field = { type: string; name: string };
export type Schema = Map<string, Field[]>;
export type Value = any;

/** A sequence of structs with one `unsigned long` and then doubles only, or floats only, as it lies in memory. */
export type Table = { count: number; stride: number; numbers: Float64Array | Float32Array; words: Uint32Array };

const SIZES: Record<string, number> = {
  double: 8, float: 4, octet: 1, boolean: 1, long: 4, "unsigned long": 4, "long long": 8, "unsigned long long": 8,
};

export function parseSchema(text: string): Schema {
  const schema: Schema = new Map();
  for (const [, name, body] of text.matchAll(/struct\s+(\w+)\s*\{([^}]*)\}/g)) {
    const fields = body
      .split(";")
      .map((part) => part.replace(/@\w+/g, "").trim())
      .filter(Boolean)
      .map((part) => {
        const at = part.lastIndexOf(" ");
        return { type: part.slice(0, at).trim(), name: part.slice(at + 1) };
      });
    schema.set(name, fields);
  }
  return schema;
}

/** The numbers of a struct that has nothing else than such numbers; -1: it has. */
function numbersOf(schema: Schema, type: string, kind: "double" | "float"): number {
  if (type === kind) return 1;
  let sum = 0;
  for (const field of schema.get(type) ?? []) {
    const more = numbersOf(schema, field.type, kind);
    if (more < 0) return -1;
    sum += more;
  }
  return sum > 0 ? sum : -1;
}

/** Kind and number of the numbers in a `Table` row; none: the struct is no such row. */
function rowOf(schema: Schema, type: string): Row | undefined {
  const [first, ...rest] = schema.get(type) ?? [];
  if (first?.type !== "unsigned long" || rest.length === 0) return undefined;
  for (const kind of ["double", "float"] as const) {
    const numbers = rest.map((field) => numbersOf(schema, field.type, kind));
    if (numbers.every((one) => one > 0)) return { kind, count: numbers.reduce((a, b) => a + b) };
  }
  return undefined;
}
type Row = { kind: "double" | "float"; count: number };

export class Decoder {
  private view = new DataView(new ArrayBuffer(0));
  private bytes = new ArrayBuffer(0);
  private at = 0;
  private readonly rows = new Map<string, Row | undefined>();
  private static readonly text = new TextDecoder();

  constructor(private readonly schema: Schema, private readonly root: string) {
    for (const name of schema.keys()) this.rows.set(name, rowOf(schema, name));
  }

  /** `cdr` begins with the header of 4 bytes. Throws where the bytes do not fit the schema. */
  decode(cdr: ArrayBuffer): Value {
    this.bytes = cdr.slice(4); // copied, so that doubles are aligned
    this.view = new DataView(this.bytes);
    this.at = 0;
    return this.struct(this.root);
  }

  private align(size: number): number {
    const at = Math.ceil(this.at / size) * size;
    this.at = at + size;
    return at;
  }

  private read(type: string): Value {
    switch (type) {
      case "double": return this.view.getFloat64(this.align(8), true);
      case "float": return this.view.getFloat32(this.align(4), true);
      case "octet": return this.view.getUint8(this.align(1));
      case "boolean": return this.view.getUint8(this.align(1)) !== 0;
      case "long": return this.view.getInt32(this.align(4), true);
      case "unsigned long": return this.view.getUint32(this.align(4), true);
      case "long long": return this.view.getBigInt64(this.align(8), true);
      case "unsigned long long": return this.view.getBigUint64(this.align(8), true);
      case "string": {
        const size = this.view.getUint32(this.align(4), true);
        const text = Decoder.text.decode(new Uint8Array(this.bytes, this.at, Math.max(0, size - 1)));
        this.at += size;
        return text;
      }
    }
    const element = /^sequence<(.*)>$/.exec(type)?.[1];
    return element ? this.sequence(element) : this.struct(type);
  }

  private struct(name: string): Value {
    const fields = this.schema.get(name);
    if (!fields) throw new Error(`the schema has no ${name}`);
    const value: Value = {};
    for (const field of fields) value[field.name] = this.read(field.type);
    return value;
  }

  private sequence(element: string): Value {
    const count = this.view.getUint32(this.align(4), true);
    const row = this.rows.get(element);
    if (row) return row.kind === "float" ? this.floats(count, row.count) : this.doubles(count, row.count);
    const size = SIZES[element] ?? 1;
    if (count * size > this.bytes.byteLength) throw new Error(`a sequence of ${count} does not fit`);
    const values: Value[] = new Array(count);
    for (let i = 0; i < count; ++i) values[i] = this.read(element);
    return values;
  }

  /** The first row begins at a multiple of 4; its doubles at the next multiple of 8, and so do those of all others. */
  private doubles(count: number, each: number): Table {
    const stride = 1 + each, numbers = new Float64Array(count * stride), words = new Uint32Array(count);
    for (let i = 0; i < count; ++i) {
      words[i] = this.view.getUint32(this.align(4), true);
      this.at = Math.ceil(this.at / 8) * 8;
      numbers.set(new Float64Array(this.bytes, this.at, each), i * stride);
      this.at += each * 8;
    }
    return { count, stride, numbers, words };
  }

  /** Rows of four-byte numbers lie side by side; `numbers` are those after the word. */
  private floats(count: number, each: number): Table {
    const stride = 1 + each, words = new Uint32Array(count);
    const from = Math.ceil(this.at / 4) * 4, bits = new Uint32Array(this.bytes, from, count * stride);
    for (let i = 0; i < count; ++i) words[i] = bits[i * stride];
    this.at = from + 4 * bits.length;
    return { count, stride, numbers: new Float32Array(this.bytes, from, bits.length).subarray(1), words };
  }
}

/** A `subworld::msg::Control`. */
export function encodeControl(number: number, verb: number, argument: string): Uint8Array {
  const text = new TextEncoder().encode(argument);
  const bytes = new Uint8Array(4 + 4 + 4 + 4 + text.length + 1);
  const view = new DataView(bytes.buffer);
  view.setUint8(1, 1);
  view.setUint32(4, number, true);
  view.setUint8(8, verb);
  view.setUint32(12, text.length + 1, true);
  bytes.set(text, 16);
  return bytes;
}

/** A `subworld::msg::ToolPose`: position, orientation w, x, y, z, buttons, and whether the tool is held. */
export function encodeToolPose(position: number[], orientation: number[], buttons: number, held: boolean): Uint8Array {
  const bytes = new Uint8Array(4 + 7 * 8 + 4 + 1), view = new DataView(bytes.buffer);
  view.setUint8(1, 1);
  [...position, ...orientation].forEach((number, i) => view.setFloat64(4 + 8 * i, number, true));
  view.setUint32(60, buttons, true);
  view.setUint8(64, held ? 1 : 0);
  return bytes;
}
