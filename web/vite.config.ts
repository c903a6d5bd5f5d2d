import { createHash } from "node:crypto";
import { readdirSync, readFileSync, statSync } from "node:fs";
import { join, relative, sep } from "node:path";
import react from "@vitejs/plugin-react";
import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

const ROOT = import.meta.dirname;
const STAMPED = ["index.html", "package.json", "package-lock.json", "public", "src", "tsconfig.json", "vite.config.ts"];

function filesIn(path: string): string[] {
  if (!statSync(path).isDirectory()) return [path];
  return readdirSync(path).flatMap((name) => filesIn(join(path, name)));
}

/** The hash of the sources goes into BUILD.json. hfg's tests compute it again in Python, so that nobody needs Node to
 * notice a bundle that was not rebuilt. */
function stamp(): Plugin {
  return {
    name: "stamp",
    generateBundle() {
      const names = STAMPED.flatMap((name) => filesIn(join(ROOT, name))).map((path) =>
        relative(ROOT, path).split(sep).join("/"),
      );
      const hash = createHash("sha256");
      for (const name of names.sort()) {
        hash.update(`${name}\0`);
        hash.update(readFileSync(join(ROOT, name)));
        hash.update("\0");
      }
      const source = `${JSON.stringify({ sources_sha256: hash.digest("hex") })}\n`;
      this.emitFile({ type: "asset", fileName: "BUILD.json", source });
    },
  };
}

export default defineConfig({
  base: "./",
  plugins: [react(), stamp()],
  build: {
    target: "es2022",
    outDir: "../hfg/studio/static",
    emptyOutDir: true,
    license: { fileName: "licenses.txt" },
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0, // the page's rules for content allow no fonts from data addresses
    rolldownOptions: {
      output: {
        entryFileNames: "assets/[name].js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
        codeSplitting: { groups: [{ name: "vendor", test: /node_modules/ }] },
      },
    },
  },
  test: { environment: "node", include: ["src/**/*.test.ts"] },
});
