/**
 * What JSON has to look like, checked where it comes in: from the server, from storage, from files.
 * The schemas of what the server sends are generated (wire.ts).
 */

/** The value is not what was expected; the message says where. */
export class SchemaError extends Error {
  override readonly name = 'SchemaError';
}

/** @returns The value, of which every field was looked at. @throws SchemaError */
export type Schema<T> = (value: unknown, path: string) => T;

/** Read JSON. @throws SchemaError It is no JSON, or not this. */
export function parseJson<T>(schema: Schema<T>, json: string): T {
  let value: unknown;
  try {
    value = JSON.parse(json);
  } catch {
    throw new SchemaError('this is not JSON');
  }
  return schema(value, '');
}

/** Read JSON that this device kept; null when there is none, or another version wrote it. */
export function parseKept<T>(schema: Schema<T>, json: string | null): T | null {
  if (json === null) return null;
  try {
    return parseJson(schema, json);
  } catch (error) {
    if (error instanceof SchemaError) return null;
    throw error;
  }
}

export const text: Schema<string> = (value, path) =>
  (typeof value === 'string' ? value : fail(path, 'a text', value));

export const flag: Schema<boolean> = (value, path) =>
  (typeof value === 'boolean' ? value : fail(path, 'true or false', value));

export const nothing: Schema<null> = (value, path) =>
  (value === null ? value : fail(path, 'null', value));

/** A finite one: JSON has no other, but 1e999. */
export function number(min = -Infinity, max = Infinity): Schema<number> {
  return (value, path) => (Number.isFinite(value) && Number(value) >= min && Number(value) <= max
    ? Number(value) : fail(path, `a number${rangeOf(min, max)}`, value));
}

export function integer(min = -Infinity, max = Infinity): Schema<number> {
  return (value, path) => (Number.isInteger(value) && Number(value) >= min && Number(value) <= max
    ? Number(value) : fail(path, `a whole number${rangeOf(min, max)}`, value));
}

export function oneOf<const T extends string>(...words: readonly T[]): Schema<T> {
  return (value, path) =>
    words.find((word) => word === value) ?? fail(path, `one of ${words.join(', ')}`, value);
}

/** The first of some schemas that fits. */
export function union<T extends readonly unknown[]>(
  ...schemas: { readonly [K in keyof T]: Schema<T[K]> }
): Schema<T[number]> {
  return (value, path) => {
    let last: unknown = null;
    for (const schema of schemas) {
      try {
        return schema(value, path);
      } catch (error) {
        last = error;
      }
    }
    throw last;
  };
}

export function nullable<T>(schema: Schema<T>): Schema<T | null> {
  return (value, path) => (value === null ? null : schema(value, path));
}

/** Of a field that may be left out; null is not the same. */
export function optional<T>(schema: Schema<T>): Schema<T> {
  return (value, path) => (value === undefined ? value as T : schema(value, path));
}

export function list<T>(item: Schema<T>, min = 0, max = Infinity): Schema<readonly T[]> {
  return (value, path) => {
    if (!Array.isArray(value) || value.length < min || value.length > max) {
      return fail(path, `a list${min === max ? ` of ${min}` : ''}`, value);
    }
    value.forEach((each, i) => item(each, `${path}[${i}]`));
    return value as readonly T[];
  };
}

export function dictionary<T>(item: Schema<T>): Schema<Readonly<Record<string, T>>> {
  return (value, path) => {
    const fields = objectOf(value, path);
    for (const [name, each] of Object.entries(fields)) item(each, join(path, name));
    return fields as Readonly<Record<string, T>>;
  };
}

/** An object with these fields; others are let through, and nobody looks at them. */
export function record<T extends object>(
  fields: { readonly [K in keyof T]-?: Schema<T[K]> },
): Schema<T> {
  const schemas = Object.entries(fields) as [string, Schema<unknown>][];
  return (value, path) => {
    const given = objectOf(value, path);
    for (const [name, schema] of schemas) schema(given[name], join(path, name));
    return given as T;
  };
}

/** One of several records, told apart by their field `type`. */
export function tagged<T extends { readonly type: string }>(
  schemas: { readonly [K in T['type']]: Schema<Extract<T, { readonly type: K }>> },
): Schema<T> {
  const known = new Map<unknown, Schema<T>>(Object.entries(schemas as Record<string, Schema<T>>));
  return (value, path) => {
    const { type } = objectOf(value, path);
    const schema = known.get(type)
      ?? fail(join(path, 'type'), `one of ${Array.from(known.keys()).join(', ')}`, type);
    return schema(value, path);
  };
}

function objectOf(value: unknown, path: string): Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value)
    ? value as Record<string, unknown> : fail(path, 'an object', value);
}

function fail(path: string, need: string, value: unknown): never {
  const got = typeof value === 'string' || typeof value === 'number' ? JSON.stringify(value)
    : value === null ? 'null' : Array.isArray(value) ? 'a list' : typeof value;
  throw new SchemaError(`${path === '' ? '' : `${path}: `}need ${need}, got ${got.slice(0, 80)}`);
}

function join(path: string, name: string): string {
  return path === '' ? name : `${path}.${name}`;
}

function rangeOf(min: number, max: number): string {
  if (min === -Infinity && max === Infinity) return '';
  if (max === Infinity) return ` of at least ${min}`;
  return ` from ${min} to ${max}`;
}
