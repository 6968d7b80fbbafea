// A browser repeats one key alone, the last, and begins after half a second: repeat all that are held, at once, until
// they are released.
if (!window.heldKeys) {
  const held = window.heldKeys = new Map();
  const press = (key, code) => document.body.dispatchEvent(new KeyboardEvent('keydown', {key, code, bubbles: true}));
  window.addEventListener('keydown', event => {
    const typed = event.ctrlKey || event.metaKey || event.altKey || event.target.closest('input, textarea, select');
    if (event.isTrusted && !typed && /^Key[IJKLUOTGFHRYZ]$/.test(event.code)) held.set(event.code, event.key);
  });
  window.addEventListener('keyup', event => held.delete(event.code) && !held.size && press('LET_GO', 'Digit0'));
  window.addEventListener('blur', () => held.clear());
  setInterval(() => held.forEach(press), PERIOD);
}
