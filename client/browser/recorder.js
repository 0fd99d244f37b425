// Screenshots and recordings of what is on the canvas.

/** @param {Blob} blob @param {string} name */
function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** crowd-20240131-235959 @param {string} crowd */
const stem = crowd => `${crowd || 'throng'}-${new Date().toISOString().slice(0, 19).replace(/[-:]/g, '').replace('T', '-')}`;

/** Saves what is seen as PNG. @param {HTMLCanvasElement} canvas @param {string} crowd
 * @returns {Promise<string>} the file's name */
export async function screenshot(canvas, crowd) {
  /** @type {Blob|null} */
  const blob = await new Promise(resolve => canvas.toBlob(resolve, 'image/png'));
  if (!blob) throw new Error('the picture could not be saved');
  const name = `${stem(crowd)}.png`;
  save(blob, name);
  return name;
}

/** Records a canvas as WebM until it is stopped. */
export class Recorder {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    /** @type {MediaRecorder|null} */
    this.recorder = null;
    this.began = 0;
    /** What the encoder has given so far. */
    this.bytes = 0;
  }

  get isOn() {
    return this.recorder !== null;
  }

  /** @param {string} crowd @param {(name: string, bytes: number) => void} saved */
  start(crowd, saved) {
    const type = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4']
                     .find(one => MediaRecorder.isTypeSupported(one));
    const recorder = new MediaRecorder(this.canvas.captureStream(30), {mimeType: type, videoBitsPerSecond: 8_000_000});
    /** @type {Blob[]} */
    const parts = [];
    this.bytes = 0;
    recorder.ondataavailable = event => {
      parts.push(event.data);
      this.bytes += event.data.size;
    };
    recorder.onstop = () => {
      const blob = new Blob(parts, {type: recorder.mimeType});
      const name = `${stem(crowd)}.${recorder.mimeType.includes('mp4') ? 'mp4' : 'webm'}`;
      if (blob.size) save(blob, name);
      saved(name, blob.size);
    };
    recorder.start(1000);
    this.recorder = recorder;
    this.began = performance.now();
  }

  stop() {
    this.recorder?.stop();
    this.recorder = null;
  }
}
