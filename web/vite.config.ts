import { resolve } from 'node:path';
import { defineConfig } from 'vite';

const page = (name: string): string => resolve(import.meta.dirname, `${name}.html`);

export default defineConfig({
  base: './',
  server: { proxy: { '/api': 'http://127.0.0.1:8000' } },
  build: {
    // The Python package serves it from here; not committed.
    outDir: '../src/peaking/server/client',
    emptyOutDir: true,
    manifest: true,
    target: 'es2022',
    chunkSizeWarningLimit: 3200,
    rollupOptions: {
      input: {
        index: page('index'), check: page('check'), devices: page('devices'),
        sessions: page('sessions'), view: page('view'),
        participant: page('participant'), study: page('study'),
      },
    },
  },
  worker: { format: 'es' },
  // A machine may have much else to do.
  test: { include: ['tests/**/*.test.ts'], testTimeout: 600_000, hookTimeout: 600_000 },
} as Parameters<typeof defineConfig>[0]);
