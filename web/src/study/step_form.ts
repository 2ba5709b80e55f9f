/** The form of a step: kept while it is filled in, handed in once; on the page and over the camera. */

import { ApiError } from '../server/api';
import { DraftKeeper, type Keeping } from './draft_keeper';
import { QuestionForm } from './form';
import { refusedItems, type Answers, type ParticipantApi, type Texts } from './study_api';
import type { ParticipantState, Questionnaire, ShownStep } from './wire';

const AGAIN_MS = 2000;

export interface StepFormListener {
  /** It was handed in; this is what comes next. */
  done(state: ParticipantState): void;
  keeping(how: Keeping): void;
}

export function stepForm(
  study: ParticipantApi, step: ShownStep, texts: Texts, listener: StepFormListener,
): { readonly form: QuestionForm; readonly keeper: DraftKeeper } {
  const keeper = new DraftKeeper(`peaking.study.draft.${study.participant}.${step.key}`,
    (answers) => study.draft(step.key, answers), (how) => listener.keeping(how));
  const draft: Answers = { ...step.draft, ...keeper.unsent };
  const form = new QuestionForm(step.form as Questionnaire, texts, draft, {
    changed: (item, answer) => keeper.change(item, answer),
    handIn: (answers) => persist(async () => {
      try {
        const state = await study.handIn(step.key, answers);
        keeper.close();
        listener.done(state);
        return null;
      } catch (error) {
        const items = refusedItems(error);
        if (items !== null) return items;
        // Out of date: another tab was faster, and this one is told the new state.
        if (error instanceof ApiError && error.status === 409) {
          listener.done(await study.state());
          return null;
        }
        throw error;
      }
    }, (how) => listener.keeping(how)),
  });
  return { form, keeper };
}

/** Try until the server has it: what a person handed in is not lost to a bad network. */
export async function persist<T>(
  attempt: () => Promise<T>, keeping: (how: Keeping) => void,
): Promise<T> {
  for (;;) {
    try {
      return await attempt();
    } catch (error) {
      const again = error instanceof ApiError && (error.status === 0 || error.status >= 500);
      if (!again) throw error;
      keeping('not_saved');
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
  }
}
