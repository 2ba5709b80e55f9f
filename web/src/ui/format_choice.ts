/** Which format a data set is downloaded in. */

import { make } from './dom';
import type { DatasetQuery } from '../wire';

export type DatasetFormat = NonNullable<DatasetQuery['format']>;

const NAMES: Record<DatasetFormat, string> = {
  nerfstudio: 'nerfstudio',
  colmap: 'COLMAP',
  'colmap-text': 'COLMAP, as text',
  'instant-ngp': 'instant-ngp',
  llff: 'LLFF',
  tum: 'TUM RGB-D',
};

/** A small choice; docs/formats.md says which program wants what. */
export class FormatChoice {
  readonly element: HTMLElement;
  readonly #select: HTMLSelectElement;

  constructor(onchange: (format: DatasetFormat) => void = () => undefined) {
    this.#select = make('select', { onchange: () => onchange(this.format) },
      ...Object.entries(NAMES).map(([value, name]) => make('option', { value }, name)));
    this.element = make('label', { className: 'format' }, 'Format ', this.#select);
  }

  get format(): DatasetFormat {
    const { value } = this.#select;
    return isFormat(value) ? value : 'nerfstudio';
  }
}

function isFormat(value: string): value is DatasetFormat {
  return Object.hasOwn(NAMES, value);
}
