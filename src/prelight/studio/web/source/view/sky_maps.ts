// The maps behind the scene, fetched when they are needed: of the light that is seen, and of another beside it.

import { fetchSky } from "../geometry";
import { skyId } from "../rig";
import { type SkyLook, type SkyUniforms, skyMap } from "./sky";

export class SkyMaps {
  private readonly ids: [string, string] = ["", ""]; // of what is lit, and of the look to compare with
  private readonly arrived: [string, string] = ["", ""];
  private readonly wanted: [string, string] = ["", ""]; // the choices that these are of
  private isFetching = false;

  /** `changed` hears that a map has come: of which choice, where it is the one that is lit. */
  constructor(private readonly sky: SkyUniforms, private readonly changed: (environment: string | null) => void) {}

  /** Ask for a map that is not there; while one is on its way only the newest of the later ones will be asked for. */
  need(look: SkyLook, side: 0 | 1): void {
    const id = skyId(look);
    if (id === this.ids[side]) return;
    this.ids[side] = id;
    this.wanted[side] = look.environment;
    if (side === 1 && id === this.arrived[0]) {
      this.sky.otherMap.value = this.sky.map.value; // the same is behind both
      this.arrived[1] = id;
    } else if (!this.isFetching) {
      void this.fetchAll();
    }
  }

  private async fetchAll(): Promise<void> {
    this.isFetching = true;
    const tried = ["", ""];
    for (let side = this.missing(tried); side !== null; side = this.missing(tried)) {
      const id = this.ids[side] ?? "";
      tried[side] = id;
      try {
        this.put(skyMap(await fetchSky(id)), side);
        this.arrived[side] = id;
        this.changed(side === 0 && id === this.ids[0] ? this.wanted[0] : null);
      } catch {
        if (id === this.ids[side]) this.ids[side] = ""; // asked for again with the next change
      }
    }
    this.isFetching = false;
  }

  private put(map: ReturnType<typeof skyMap>, side: 0 | 1): void {
    const { map: first, otherMap: second } = this.sky;
    const place = side === 0 ? first : second;
    if (first.value !== second.value) place.value.dispose();
    place.value = map;
  }

  private missing(tried: readonly string[]): 0 | 1 | null {
    for (const side of [0, 1] as const) {
      const id = this.ids[side] ?? "";
      if (id !== "" && id !== this.arrived[side] && id !== tried[side]) return side;
    }
    return null;
  }
}
