/** Compiles shaders, and fails loudly. */

/** A shader that does not compile: the driver's log, and the source with numbered lines. */
export class ShaderError extends Error {
  override readonly name = 'ShaderError';
}

export class Program implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #uniforms = new Map<string, WebGLUniformLocation | null>();

  constructor(gl: WebGL2RenderingContext, vertex: string, fragment: string) {
    this.#gl = gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind);
      if (shader === null) throw new ShaderError('the graphics context is lost');
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
      if (gl.getShaderParameter(shader, gl.COMPILE_STATUS) === false) {
        throw new ShaderError(`${gl.getShaderInfoLog(shader) ?? ''}\n${numbered(source)}`);
      }
    }
    gl.linkProgram(program);
    if (gl.getProgramParameter(program, gl.LINK_STATUS) === false) {
      throw new ShaderError(gl.getProgramInfoLog(program) ?? 'does not link');
    }
    this.#program = program;
  }

  use(): void {
    this.#gl.useProgram(this.#program);
  }

  uniform(name: string): WebGLUniformLocation | null {
    let location = this.#uniforms.get(name);
    if (location === undefined) {
      location = this.#gl.getUniformLocation(this.#program, name);
      this.#uniforms.set(name, location);
    }
    return location;
  }

  [Symbol.dispose](): void {
    this.#gl.deleteProgram(this.#program);
  }
}

function numbered(source: string): string {
  return source.split('\n').map((line, i) => `${String(i + 1).padStart(3)} ${line}`).join('\n');
}
