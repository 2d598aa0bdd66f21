// One script, one stylesheet, one page, under names that stay: the bundle is committed, and a rebuild gives its bytes.
import { defineConfig } from "vite";

export default defineConfig({
  root: "source",
  base: "./",
  publicDir: false,
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
