/** Touches of the picture itself: neither of what lies over it, nor the end of a drag. */

/** A finger that moved farther than this between down and up was dragged. */
const STILL_PX = 12;

const OVER_THE_PICTURE = 'button, a, input, textarea, select, label, .meter, .coach, .sheet, .start, .guide';

/** Call back with the place on the page; a click of a mouse is a touch. */
export function onTouch(page: Window, touched: (clientX: number, clientY: number) => void): void {
  let x = NaN;
  let y = NaN;
  page.addEventListener('pointerdown', (event) => {
    x = event.clientX;
    y = event.clientY;
  }, { capture: true });
  page.addEventListener('click', (event) => {
    const { target, clientX, clientY } = event;
    if (target instanceof Element && target.closest(OVER_THE_PICTURE) !== null) return;
    if (Math.hypot(clientX - x, clientY - y) > STILL_PX) return;
    touched(clientX, clientY);
  });
}
