// Numbers as words, as the command line says them.

export function count(number: number): string {
  if (number >= 1e9) return `${(number / 1e9).toPrecision(3)} billion`;
  if (number >= 1e6) return `${(number / 1e6).toPrecision(3)} million`;
  return Math.round(number).toLocaleString("en");
}

export function bytes(number: number): string {
  for (const [unit, scale] of [["GB", 1e9], ["MB", 1e6], ["kB", 1e3]] as const) {
    if (number >= scale) return `${Number((number / scale).toPrecision(3))} ${unit}`;
  }
  return `${Math.round(number)} bytes`;
}

export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 100) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 100 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export function rate(raysPerSecond: number): string {
  return `${count(raysPerSecond)} rays/s`;
}
