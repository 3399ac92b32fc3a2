// Machines and tools that a program can be checked for.

import { call } from "./grpc.js";

const PAGE = 500;
/** More than these nobody chooses from. */
const MOST_PAGES = 4;

const readAll = async (method, key, signal) => {
  const all = [];
  let pageToken = "";
  for (let page = 0; page < MOST_PAGES; page += 1) {
    const answer = await call(method, { pageSize: PAGE, pageToken }, { signal });
    all.push(...answer[key]);
    pageToken = answer.nextPageToken;
    if (!pageToken) break;
  }
  return all;
};

export const readMachines = (signal) => readAll("Machines/ListMachines", "machines", signal);
export const readTools = (signal) => readAll("Tools/ListTools", "tools", signal);

export const machineName = (machine) => machine.displayName || machine.name.replace("machines/", "");
export const isLathe = (machine) => machine?.profile?.machine?.kind === "MACHINE_KIND_LATHE";
