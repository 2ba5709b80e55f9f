/** A questionnaire as a plain HTML form: labels, fieldsets, keyboard, and what is missing on top. */

import { make } from '../ui/dom';
import { problemsOf, rangeOf } from './answer_rules';
import { fill, type Answer, type Answers, type Texts } from './study_api';
import { MAX_TEXT, type Item, type Questionnaire } from './wire';

export interface FormActions {
  /** An answer was changed by the person. */
  changed(item: string, answer: Answer): void;
  /** @returns What the server finds wrong, per item; null when it was taken. */
  handIn(answers: Answers): Promise<Readonly<Record<string, string>> | null>;
}

interface Field {
  readonly item: Item;
  /** What is marked and what the summary leads to. */
  readonly box: HTMLElement;
  readonly first: HTMLElement;
  readonly problem: HTMLElement;
  read(): Answer;
  write(answer: Answer): void;
}

export class QuestionForm {
  readonly element: HTMLFormElement;
  readonly #fields: readonly Field[];
  readonly #summary = make('div', { className: 'summary', hidden: true, tabIndex: -1 });
  readonly #button: HTMLButtonElement;
  readonly #touched = new Set<string>();
  #busy = false;

  constructor(
    readonly form: Questionnaire, readonly texts: Texts, draft: Answers,
    readonly actions: FormActions,
  ) {
    this.#fields = form.items.map((item) => makeField(item, texts));
    this.#button = make('button', { className: 'primary', type: 'submit' }, texts['hand_in'] ?? '');
    this.#summary.setAttribute('role', 'alert');
    this.element = make('form', { className: 'form', noValidate: true },
      make('h1', {}, form.title), ...paragraphs(form.instruction ?? ''), this.#summary,
      ...this.#fields.map((field) => field.box), this.#button);
    this.element.autocomplete = 'off';
    for (const field of this.#fields) {
      field.write(draft[field.item.id] ?? null);
      const heard = (): void => this.#changed(field);
      field.box.addEventListener('input', heard);
    }
    this.element.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#handIn();
    });
  }

  get answers(): Answers {
    return Object.fromEntries(this.#fields.map((field) => [field.item.id, field.read()]));
  }

  /** Take what another tab filled in, where this one has not been touched. */
  merge(draft: Answers): void {
    for (const field of this.#fields) {
      const answer = draft[field.item.id];
      if (answer === undefined || this.#touched.has(field.item.id)) continue;
      if (!field.box.contains(document.activeElement)) field.write(answer);
    }
  }

  #changed(field: Field): void {
    this.#touched.add(field.item.id);
    this.actions.changed(field.item.id, field.read());
    if (!field.problem.hidden && !problemsOf(this.form, this.answers).has(field.item.id)) {
      mark(field, null);
    }
  }

  async #handIn(): Promise<void> {
    if (this.#busy) return; // pressed twice
    const found = problemsOf(this.form, this.answers);
    if (found.size > 0) return this.#show(found);
    this.#busy = true;
    this.#button.disabled = true;
    try {
      const wrong = await this.actions.handIn(this.answers);
      if (wrong !== null) this.#show(new Map(Object.entries(wrong)));
    } finally {
      this.#busy = false;
      this.#button.disabled = false;
    }
  }

  #show(problems: ReadonlyMap<string, string>): void {
    const links: HTMLElement[] = [];
    for (const field of this.#fields) {
      const problem = problems.get(field.item.id);
      const sentence = problem === undefined ? null : this.#sentence(problem, field.item);
      mark(field, sentence);
      if (sentence === null) continue;
      const link = make('a', { href: `#${field.first.id}` }, plain(field.item.text));
      link.onclick = (event) => {
        event.preventDefault();
        field.box.scrollIntoView({ block: 'center' });
        field.first.focus({ preventScroll: true });
      };
      links.push(make('li', {}, link));
    }
    this.#summary.replaceChildren(make('h2', {}, this.texts['problems_title'] ?? ''),
      make('p', {}, this.texts['problems_text'] ?? ''), make('ul', {}, ...links));
    this.#summary.hidden = links.length === 0;
    this.#summary.scrollIntoView({ block: 'start' });
    this.#summary.focus({ preventScroll: true });
  }

  #sentence(problem: string, item: Item): string {
    const [low, high] = rangeOf(item);
    return fill(this.texts[problem] ?? problem, { low, high });
  }
}

/** Paragraphs of a text; empty lines part them. */
export function paragraphs(text: string): HTMLElement[] {
  return text.split(/\n\s*\n/).filter((part) => part.trim() !== '')
    .map((part) => make('p', {}, part.replace(/\s+/g, ' ').trim()));
}

function mark(field: Field, sentence: string | null): void {
  field.problem.textContent = sentence ?? '';
  field.problem.hidden = sentence === null;
  field.box.classList.toggle('wrong', sentence !== null);
  for (const control of controlsOf(field.box)) {
    if (sentence === null) control.removeAttribute('aria-invalid');
    else control.setAttribute('aria-invalid', 'true');
  }
}

function controlsOf(box: HTMLElement): readonly HTMLElement[] {
  return Array.from(box.querySelectorAll<HTMLElement>('input, textarea'));
}

function makeField(item: Item, texts: Texts): Field {
  switch (item.kind) {
    case 'scale': return scaleField(item, texts);
    case 'rating': return ratingField(item, texts);
    case 'choice': case 'choices': return choiceField(item, texts);
    case 'number': return numberField(item, texts);
    case 'text': return textField(item, texts);
    default: return item.kind satisfies never;
  }
}

function scaleField(item: Item, texts: Texts): Field {
  const points = item.points ?? 7;
  const radios = Array.from({ length: points }, (_, i) => {
    const radio = make('input', {
      type: 'radio', name: item.id, value: String(i + 1), id: `${item.id}-${i + 1}`,
    });
    const end = i === 0 ? item.low : i === points - 1 ? item.high : '';
    if (end !== undefined && end !== '') radio.ariaLabel = `${i + 1}: ${end}`;
    return radio;
  });
  const row = make('div', { className: 'points' }, ...radios.map((radio) =>
    make('label', { htmlFor: radio.id }, radio, make('span', {}, radio.value))));
  row.style.setProperty('--points', String(points));
  return {
    ...group(item, texts, radios[0] as HTMLElement, row, ends(item)),
    read: () => checkedNumber(radios),
    write: (answer) => { for (const radio of radios) radio.checked = radio.value === String(answer); },
  };
}

/** A slider that says that it has not been moved yet: its middle is no answer. */
function ratingField(item: Item, texts: Texts): Field {
  const slider = make('input', {
    type: 'range', id: item.id, min: '0', max: '100', step: '5', value: '50', className: 'unmoved',
  });
  const output = make('output');
  output.setAttribute('for', item.id);
  let moved = false;
  const show = (): void => {
    slider.classList.toggle('unmoved', !moved);
    output.textContent = moved ? slider.value : texts['not_moved'] ?? '';
    slider.setAttribute('aria-valuetext', output.textContent);
  };
  // A tap on the middle changes nothing, and yet is an answer.
  const touch = (): void => {
    if (moved) return;
    moved = true;
    show();
    slider.dispatchEvent(new Event('input', { bubbles: true }));
  };
  slider.addEventListener('pointerup', touch);
  slider.addEventListener('keyup', (event) => { if (event.key === ' ' || event.key === 'Enter') touch(); });
  slider.addEventListener('input', () => { moved = true; show(); });
  show();
  const label = make('label', { htmlFor: item.id }, item.text, ...asterisk(item, texts));
  const problem = problemLine(item);
  describe([slider], item, problem);
  const box = make('div', { className: 'question rating' }, label, ...help(item), problem, slider,
    ends(item), output);
  return {
    item, box, first: slider, problem,
    read: () => (moved ? Number(slider.value) : null),
    write: (answer) => {
      moved = typeof answer === 'number';
      slider.value = String(answer ?? 50);
      show();
    },
  };
}

function choiceField(item: Item, texts: Texts): Field {
  const several = item.kind === 'choices';
  const inputs = (item.choices ?? []).map((choice) => make('input', {
    type: several ? 'checkbox' : 'radio', name: item.id, value: choice.value,
    id: `${item.id}-${choice.value}`,
  }));
  const list = make('div', { className: 'choices' }, ...inputs.map((input, i) =>
    make('label', { htmlFor: input.id }, input, make('span', {}, item.choices?.[i]?.text ?? ''))));
  const checked = (): string[] => inputs.filter((input) => input.checked).map((input) => input.value);
  const hint = several ? [make('p', { className: 'hint' }, texts['choose_several'] ?? '')] : [];
  return {
    ...group(item, texts, inputs[0] as HTMLElement, ...hint, list),
    read: () => (several ? checked() : checked()[0] ?? null),
    write: (answer) => {
      const values = Array.isArray(answer) ? answer : [answer];
      for (const input of inputs) input.checked = values.includes(input.value);
    },
  };
}

function numberField(item: Item, texts: Texts): Field {
  const input = make('input', { type: 'text', id: item.id, inputMode: 'decimal', size: 8 });
  return lineField(item, texts, input, () => {
    const text = input.value.trim().replace(',', '.');
    if (text === '') return null;
    const value = Number(text);
    return Number.isFinite(value) ? value : input.value;
  });
}

function textField(item: Item, texts: Texts): Field {
  const input = make('textarea', { id: item.id, rows: 4, maxLength: MAX_TEXT });
  return lineField(item, texts, input, () => (input.value.trim() === '' ? null : input.value));
}

function lineField(
  item: Item, texts: Texts, input: HTMLInputElement | HTMLTextAreaElement, read: () => Answer,
): Field {
  const label = make('label', { htmlFor: item.id }, item.text, ...asterisk(item, texts));
  const problem = problemLine(item);
  describe([input], item, problem);
  const box = make('div', { className: 'question' }, label, ...help(item), problem, input);
  const write = (answer: Answer): void => { input.value = answer === null ? '' : String(answer); };
  return { item, box, first: input, problem, read, write };
}

function group(
  item: Item, texts: Texts, first: HTMLElement, ...content: HTMLElement[]
): Pick<Field, 'item' | 'box' | 'first' | 'problem'> {
  const problem = problemLine(item);
  const box = make('fieldset', { className: 'question' },
    make('legend', {}, item.text, ...asterisk(item, texts)), ...help(item), problem, ...content);
  describe([box], item, problem);
  return { item, box, first, problem };
}

function describe(controls: readonly HTMLElement[], item: Item, problem: HTMLElement): void {
  const ids = [item.help ? `${item.id}-help` : '', problem.id].filter((id) => id !== '');
  for (const control of controls) control.setAttribute('aria-describedby', ids.join(' '));
}

function problemLine(item: Item): HTMLElement {
  return make('p', { className: 'problem', id: `${item.id}-problem`, hidden: true });
}

function help(item: Item): HTMLElement[] {
  return item.help ? [make('p', { className: 'hint', id: `${item.id}-help` }, item.help)] : [];
}

function asterisk(item: Item, texts: Texts): HTMLElement[] {
  return item.optional === true
    ? [make('small', {}, ` (${texts['optional'] ?? 'optional'})`)] : [];
}

function ends(item: Item): HTMLElement {
  const box = make('div', { className: 'ends' }, make('span', {}, item.low ?? ''),
    make('span', {}, item.high ?? ''));
  box.ariaHidden = 'true'; // the end points say it themselves
  return box;
}

function checkedNumber(radios: readonly HTMLInputElement[]): number | null {
  const checked = radios.find((radio) => radio.checked);
  return checked === undefined ? null : Number(checked.value);
}

/** The question without what stands after its colon, for the summary. */
function plain(text: string): string {
  return text.length > 80 ? `${text.slice(0, 77)} …` : text;
}
