// Compiles scripts with the WebAssembly module: node compile.mjs MODULE < input.json > outputs.json
// The input is {"files": {NAME: TEXT, …}, "mains": [NAME, …]}; the output is an array of the results of examples/wasm.rs.
import { readFileSync } from "node:fs";

const { instance } = await WebAssembly.instantiate(readFileSync(process.argv[2]), {});
const { memory, allocate, release, compile } = instance.exports;

function compiled(input) {
  const bytes = new TextEncoder().encode(JSON.stringify(input));
  const at = allocate(bytes.length);
  new Uint8Array(memory.buffer, at, bytes.length).set(bytes);
  const result = compile(at, bytes.length);
  const length = new DataView(memory.buffer).getUint32(result, true);
  const text = new TextDecoder().decode(new Uint8Array(memory.buffer, result + 4, length));
  release(result, length + 4);
  return JSON.parse(text);
}

const { files, mains } = JSON.parse(readFileSync(0, "utf8"));
process.stdout.write(JSON.stringify(mains.map((main) => compiled({ main, files }))));
