import type { Fit, Targets } from "../protocol/types";
import { question } from "./actions";
import { endsOf } from "./paths";
import { studio } from "./studio";

/** What an edge may lead to, by the path of the port. */
export interface Judged extends Targets {
  ports: ReadonlyMap<string, Fit>;
}

export async function askTargets(port: string, moving: string): Promise<Judged> {
  const said = await question<Targets>("targets", { port, moving });
  return { ...said, ports: byPort(said) };
}

export const byPort = ({ fits }: Targets): Map<string, Fit> => new Map(fits.flatMap((fit) => fit.ports.map((port): [string, Fit] => [port, fit])));

/** Why a port refuses, in its own name. */
export function reasonOf(fit: Fit, port: string): string {
  const before = Object.keys(studio().tables.edges).find((key) => endsOf(key)[1] === port);
  return fit.reason.replaceAll("{port}", `"${port}"`).replaceAll("{from}", `"${endsOf(before ?? "")[0]}"`);
}
