// What the workbench asks of its server; answers are JSON, a refusal is an error of one line.

export async function ask(name, content) {
  const answer = await fetch(name, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(content ?? {}),
  });
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.hint ? `${found.error} (${found.hint})` : found.error);
  return found;
}

export async function fetched(name) {
  return (await fetch(name)).json();
}

// asks with the newest content only while an answer is waited for
export function latest(name, show, complain) {
  let waiting = null;
  let running = false;
  return async (content) => {
    waiting = content;
    if (running) return;
    running = true;
    while (waiting) {
      const asked = waiting;
      waiting = null;
      try {
        show(await ask(name, asked), asked);
      } catch (problem) {
        complain(problem.message);
      }
    }
    running = false;
  };
}
