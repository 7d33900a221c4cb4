// Actions of the user on the plant. All of them use these functions, which record the action and show its error.

import { Problem, post, server } from "./api.js";
import { feed } from "./feed.js";
import { clearError, showError, showNote } from "./messages.js";
import { addToRecord } from "./record.js";

/** The reason why controls that change something are disabled, or an empty text. */
export function whyDisabled() {
  if (server.isReadOnly) return "This server was started with --read-only";
  if (feed.hasEnded) return "The emulator has ended";
  return "";
}

/**
 * Sends an operation, records it with `words` and the name of its register, and shows the note `done`. Without a note, a success removes
 * the previous error message, unless `done` is false. Returns the reply; null after an error.
 */
export async function act(operation, fields, words, done, register) {
  const before = feed.timeUs;
  try {
    const reply = await post(operation, fields);
    addToRecord({ operation, fields, register, words, reply, beforeUs: before });
    if (reply?.time !== undefined) feed.noticeTime(reply.time);
    report(done);
    return reply ?? true;
  } catch (problem) {
    showError(problem);
    return null;
  }
}

function report(done) {
  if (done) showNote(done);
  else if (done !== false) clearError();
}

/** Sends several operations as one request. `explain` returns the error to show for a wait that has failed. */
export async function actTogether(operations, words, done, explain) {
  const before = feed.timeUs;
  try {
    const { replies } = await post("request", { operations });
    addToRecord({ operations, words, replies, beforeUs: before });
    const ended = replies.at(-1)?.waited?.time_us;
    if (ended !== undefined) feed.noticeTime(ended);
    report(done);
    return replies;
  } catch (problem) {
    const waited = problem instanceof Problem && problem.document.waited;
    if (waited) {
      // A wait that has failed is recorded, too. When the scenario runs, this step fails in the same way.
      addToRecord({ operations, words: `${words}: not true in time`, replies: operations.map(() => ({ waited })), beforeUs: before });
      feed.noticeTime(waited.time_us);
    }
    showError((waited && (await explain?.().catch(() => null))) || problem);
    return null;
  }
}

/** Disables the controls of an area that change something, and sets the reason as their tooltip. */
export function guard(area) {
  const why = whyDisabled();
  for (const control of area.querySelectorAll("[data-acts]")) {
    const own = control.dataset.why ?? "";
    control.disabled = Boolean(why || own);
    const title = why || own || control.dataset.title || "";
    if (control.title !== title) control.title = title;
  }
}
