import { expect, test } from 'vitest';
import blendFragment from '../../src/render/blend.frag.glsl?raw';
import { ViewRenderer } from '../../src/render/view_renderer';
import { MAX_NEIGHBOURS, type Options } from '../../src/wire';

test('the shader blends as many views as the wire allows', () => {
  expect(blendFragment).toContain(`const int MAX_VIEWS = ${MAX_NEIGHBOURS};`);
  expect(blendFragment.match(/add\(texture\(views\[\d+\]/g)).toHaveLength(MAX_NEIGHBOURS);
});

test('more than that is refused, and not cut off in silence', () => {
  const options = { neighbours: MAX_NEIGHBOURS + 1 } as Options;
  expect(() => new ViewRenderer({} as WebGL2RenderingContext, options))
    .toThrow(`need neighbours <= ${MAX_NEIGHBOURS}, got ${MAX_NEIGHBOURS + 1}`);
});
