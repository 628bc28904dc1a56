/** Requests to the mission server; the cookie of the page speaks for its user. */

/** An answer that is an error, as the server explains it. */
export class ApiError extends Error {
  /**
   * @param {number} status HTTP status; 0 if there was no answer
   * @param {{problem?: string, field?: string | null, remedy?: string}} why
   */
  constructor(status, why) {
    const field = why.field ? `${why.field}: ` : "";
    const remedy = why.remedy ? ` (${why.remedy})` : "";
    super(field + (why.problem ?? `the server answered ${status}`) + remedy);
    this.status = status;
  }
}

/** @param {string} path @returns {Promise<any>} the answer's JSON */
export function get(path) {
  return send(path, { method: "GET" });
}

/** @param {string} path @param {object} body @returns {Promise<any>} the answer's JSON */
export function post(path, body) {
  const headers = { "content-type": "application/json" };
  return send(path, { method: "POST", headers, body: JSON.stringify(body) });
}

/** @param {string} path @param {RequestInit} init */
async function send(path, init) {
  let response;
  try {
    response = await fetch(path, { ...init, credentials: "same-origin", cache: "no-store" });
  } catch {
    throw new ApiError(0, { problem: "the server does not answer" });
  }
  const answer = await response.json().catch(() => null);
  if (!response.ok) throw new ApiError(response.status, answer?.error ?? {});
  return answer;
}
