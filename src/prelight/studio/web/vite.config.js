// One script, one stylesheet, one page, under names that stay: the bundle is committed, and a rebuild gives its bytes.
import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { defineConfig } from "vite";

const BESIDE = ["package-lock.json", "package.json", "tsconfig.json", "vite.config.js"];

/** Writes a digest of all that the bundle was made from, so that a stale one is found without building. */
function sources() {
  return {
    name: "sources",
    generateBundle() {
      const inside = readdirSync("source", { recursive: true, withFileTypes: true })
        .filter((entry) => entry.isFile())
        .map((entry) => `${entry.parentPath}/${entry.name}`.replaceAll("\\", "/"));
      const digest = createHash("sha256");
      for (const path of [...inside, ...BESIDE].sort()) digest.update(`${path}\0`).update(readFileSync(path)).update("\0");
      this.emitFile({ type: "asset", fileName: "sources.sha256", source: `${digest.digest("hex")}\n` });
    },
  };
}

export default defineConfig({
  root: "source",
  base: "./",
  publicDir: false,
  plugins: [sources()],
  build: {
    outDir: "../built",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1000,
    license: { fileName: "licenses.md" },
    rolldownOptions: {
      output: {
        codeSplitting: false,
        entryFileNames: "studio.js",
        assetFileNames: (asset) => (asset.names[0]?.endsWith(".css") ? "studio.css" : "[name][extname]"),
      },
    },
  },
});
