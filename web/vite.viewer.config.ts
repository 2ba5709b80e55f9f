/**
 * The viewer as one classic script, for pages that open from the disk (`peaking share --out x.html`):
 * nothing in it is fetched, so dynamic imports, workers and shaders are inside.
 */

import { resolve } from 'node:path';
import { defineConfig, type Plugin } from 'vite';

const WORKER = /new Worker\(\s*new URL\((['"][^'"]+['"]),\s*import\.meta\.url\),\s*\{\s*type:\s*'module',?\s*\}\s*\)/g;

/** Workers of files from the disk start from a blob, as classic scripts. */
const inlineWorkers: Plugin = {
  name: 'inline-workers',
  enforce: 'pre',
  transform(code, id) {
    if (!id.endsWith('.ts') || !code.includes('new Worker(')) return undefined;
    const imports: string[] = [];
    const inlined = code.replace(WORKER, (_whole: string, file: string) => {
      const name = `InlinedWorker${imports.length}`;
      imports.push(`import ${name} from ${file.slice(0, -1)}?worker&inline${file.slice(-1)};`);
      return `new ${name}()`;
    });
    return `${imports.join('\n')}\n${inlined}`;
  },
};

/** `--mode light_field` leaves three.js out, `--mode all` has it. */
export default defineConfig(({ mode }) => ({
  publicDir: false,
  plugins: [inlineWorkers],
  build: {
    outDir: '../src/peaking/server/client/viewer',
    emptyOutDir: false,
    target: 'es2022',
    chunkSizeWarningLimit: 8000,
    lib: {
      entry: resolve(import.meta.dirname, `src/view/shared_${mode}.ts`),
      name: 'peakingViewer',
      formats: ['iife'],
      fileName: () => `viewer_${mode}.js`,
      cssFileName: `viewer_${mode}`,
    },
  },
  worker: { format: 'iife' },
}));
