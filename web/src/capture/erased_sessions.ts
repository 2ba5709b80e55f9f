/** What the server erased is erased on this device too, also when no page of that session is open. */

import { ApiError, isRefusal, type Api } from '../server/api';
import type { CaptureDb } from './capture_db';

/**
 * Ask the server about sessions, and forget those that it erased.
 *
 * @returns Those it could not be asked about.
 */
export async function forgetErased(
  api: Pick<Api, 'session'>, db: CaptureDb, sessionIds: readonly string[],
  onErased: (sessionId: string) => void = () => undefined,
): Promise<readonly string[]> {
  const unasked: string[] = [];
  for (const [at, id] of sessionIds.entries()) {
    try {
      await api.session(id);
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      if (error.kind === 'erased') {
        await db.eraseSession(id);
        onErased(id);
      } else if (error.status === 0) return [...unasked, ...sessionIds.slice(at)];
      else if (!isRefusal(error)) unasked.push(id);
    }
  }
  return unasked;
}
