// Fails where modules of a folder import each other in a circle, and says which.

import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";

const folder = resolve(process.argv[2]);
const IMPORT = /^(?:import|export)\b[^;]*?"(\.[^"]+)";/gm;
const known = new Set(); // modules from which no circle is reached

function follow(module, path) {
  if (path.includes(module)) {
    console.error([...path.slice(path.indexOf(module)), module].map((one) => one.slice(folder.length + 1)).join(" -> "));
    process.exit(1);
  }
  if (known.has(module)) return;
  for (const [, name] of readFileSync(module, "utf8").matchAll(IMPORT)) follow(join(dirname(module), name), [...path, module]);
  known.add(module);
}

for (const name of readdirSync(folder, { recursive: true })) if (name.endsWith(".js")) follow(join(folder, name), []);
if (known.size < 10) throw new Error(`only ${known.size} modules in ${folder}`);
