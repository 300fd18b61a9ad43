// One question at a time, and one more if anything was told meanwhile: what is shown is never older than what is known.
// Two at once may be answered in the wrong order. The promise is that of a question that began after the call.

export function latest(work) {
  let running = null, again = null;
  const begin = () => {
    running = work().finally(() => { running = null; });
    return running;
  };
  const next = () => {
    again = null;
    return begin();
  };
  return () => again ?? (running ? (again = running.then(next, next)) : begin());
}
