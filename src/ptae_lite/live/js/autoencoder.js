// The image encoder of chapter 02 and its decoder.
"use strict";
PtaeLive.Autoencoder = class {
  static PIXELS = 120 * 160;
  static async open() {
    const [pack] = await PtaeLive.load(["autoencoder"]);
    const networks = PtaeLive.networks(pack);
    await networks.encode.open(); // starts the runtime, while other packs are unpacked
    return new PtaeLive.Autoencoder(networks);
  }
  constructor(networks) {
    this.networks = networks;
    this.image = new Float32Array(3 * PtaeLive.Autoencoder.PIXELS); // of every look: the runtime copies it
  }
  // An ImageData of 160 x 120, or an object with its data, to thirty numbers. One after another.
  async encode({data}) {
    const n = PtaeLive.Autoencoder.PIXELS, {image} = this;
    for (let c = 0; c < 3; c++)
      for (let i = 0; i < n; i++) image[c * n + i] = data[4 * i + c] / 255;
    const {features} = await this.networks.encode.run({image: [image, 1, 3, 120, 160]});
    return features.data;
  }
  // Thirty numbers to three channels, values 0 to 1.
  async decode(features) {
    const {image} = await this.networks.decode.run({features: [Float32Array.from(features), 1, 30]});
    return image.data;
  }
  // Thirty numbers to an ImageData.
  async draw(features) {
    const n = PtaeLive.Autoencoder.PIXELS, drawn = await this.decode(features), image = new ImageData(160, 120);
    for (let i = 0; i < n; i++) {
      for (let c = 0; c < 3; c++) image.data[4 * i + c] = Math.round(255 * drawn[c * n + i]);
      image.data[4 * i + 3] = 255;
    }
    return image;
  }
};
