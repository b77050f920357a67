// How many of 16 shades of red each picture of the page has.
() => [...document.querySelectorAll('img')]
  .filter(image => image.src.startsWith('blob:') && image.naturalWidth > 50)
  .map(image => {
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 100;
    const pen = canvas.getContext('2d');
    pen.drawImage(image, 0, 0, 100, 100);
    const pixels = pen.getImageData(0, 0, 100, 100).data;
    const seen = new Set();
    for (let k = 0; k < pixels.length; k += 4) seen.add(pixels[k] >> 4);
    return seen.size;
  })
