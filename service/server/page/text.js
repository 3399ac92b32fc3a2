// Words of the page in both languages, and numbers as the language writes them.

const WORDS = {
  en: {
    brand: "feedwave", skip: "Skip to content", board: "Board", jobs: "Jobs", other: "Deutsch",
    themeAuto: "Theme: system", themeLight: "Theme: light", themeDark: "Theme: dark",
    loading: "Loading …", failed: "This could not be read: {reason}", missing: "There is no such page.",
    lost: "No connection to the service since {time}. What is shown is not current.",
    token: "Access token", tokenWhy: "The service wants to know who you are.", tokenGo: "Continue",
    noMachines: "There are no machines.", noneMatches: "No machine is in such a state.",
    all: "All", attention: "Attention", wall: "Wall", dense: "Dense", page: "Page {page} of {pages}",
    filter: "Show", view: "View",
    now: "now", decidedAgo: "decided {age} ago",
    noData: "no data", idle: "idle", ready: "ready", running: "running", held: "held", stopped: "stopped", done: "done",
    fault: "fault", interrupted: "interrupted",
    feed: "Feed", spindle: "Spindle", override: "Feed override", left: "left", line: "line {line}", tool: "T{tool}",
    deviation: "Deviation", amplitude: "Vibration amplitude", frequency: "Vibration frequency",
    limits: "{lower} to {upper} {unit}", further: "and {count} more", age: "data is {age} old",
    pathFeed: "Path feed", machine: "Machine", job: "Job", program: "Program", run: "Run", state: "State",
    created: "Created", findings: "Findings", errors: "errors: {count}", warnings: "warnings: {count}", notes: "notes: {count}", none: "none",
    progress: "Progress", queued: "place {place} in the queue", validated: "{percent} read", more: "Show more",
    pending: "waiting", validating: "being validated", jobReady: "ready", rejected: "rejected", cancelled: "cancelled",
    jobFailed: "failed", unknown: "unknown", sinceTime: "since {time}", dominant: "Dominant line",
    decisions: "Decisions", decisionsLast: "The last {count} of {all} decisions", noDecisions: "No decision has been made yet.", decision: "Decision {number}", time: "Time",
    action: "Action", reason: "Reason", seen: "Seen", limit: "Limit", before: "Before", after: "After", trends: "Trends",
    window: "Window", samples: "{valid} of {all} samples", condition: "Conditions", acknowledged: "acknowledged by {name}",
    toAcknowledge: "not acknowledged", noConditions: "Nothing needs attention.", spindleSpeed: "Spindle speed",
    next: "Next finding", previous: "Previous finding", cure: "Cure", noFindings: "Validation found nothing.",
    noReport: "There is no report yet.", source: "Source", duration: "Machining time",
    path: "Path", lines: "Lines", occurrences: "{count} times", inFile: "in {file}",
    tooLong: "Only the first {size} of the program are shown.",
    chart: "{name}: {from} to {to}, last {last} {unit}", empty: "no values yet", bounds: "at its bound", live: "live run",
    telemetryRun: "telemetry", keyboard: "Keys: n and p go to the next and the previous finding.",
    noEvidence: "no evidence", heldByOperator: "held by the operator", otherRuns: "+{count} runs",
    otherRun: "+1 run", ofOtherRun: "another run", overrideDecided: "Feed override, decided until {time}, from then on in force",
    allDecided: "Feed override, decided", notShown: "The machine shows another run: what needs attention here is not told.",
    tenant: "Tenant", tenantGo: "Show", leave: "Sign out {name}", check: "Check", checkTitle: "Check a program", runs: "Runs", programLine: "Program line", edit: "Edit a copy",
    choose: "Choose a file", tools: "Tools", toolsAny: "Tools: any", toolsSome: "Tools: {count}", createJob: "Create job",
    createJobs: "Create {count} jobs", checking: "checking …", foundCount: "found: {count}", cuttingTime: "Cutting time",
    sections: "Vibrating sections", checkEmpty: "Drop a program here, choose a file or type. Nothing is stored.",
    checkTooLarge: "{name} has {size}; up to {limit} can be checked here. A larger program becomes a job.",
    checkForeign: "The file is not UTF-8; it was read as Windows-1252.", checkFailed: "This could not be done: {reason}",
    checkViewer: "Only the interpreter's findings are shown: validation needs the role planner.",
    editorKeys: "Keys: F8 and Shift F8 go to the next and the previous finding, Alt Enter applies its cure.",
    cureWith: "Replace by", curesBy: "Take it out", drawing: "Path", viewSpace: "Space", viewTop: "Top", viewFront: "Front",
    viewSide: "Side", viewLathe: "Lathe", pathRapid: "rapid", pathCut: "cut", pathVibrating: "cut with vibration",
    drawnToError: "drawn up to the first error", pathLong: "only the first {moves} moves are drawn", radius: "X is a radius",
    drawingKeys: "Drag turns, Shift and drag moves, the wheel enlarges. Keys: arrows, Shift arrows, + and −, 0 for all of it, 1 to 4 for the views.",
    chips: "Chips", chipProgrammed: "Programmed: {frequency} Hz, amplitude {amplitude} mm",
    chipSuggested: "For comparison: {frequency} Hz, amplitude {amplitude} mm", chipThickness: "Chip thickness",
    chipTracks: "Tracks of successive revolutions: where they cross, the chip breaks", chipRevolutions: "chip thickness over revolutions of the spindle; below 0: air",
    chipAngle: "tool position over the spindle angle, degrees, in 4 successive revolutions", chipPerRev: "{count} vibrations per revolution",
    chipBreaks: "the chip breaks", chipInPhase: "in phase, no amplitude breaks the chip",
    chipShort: "the amplitude is {percent} % of what breaks the chip",
    chipLines: "Lines {first} to {last} · {spindle} /min · {feed} mm/rev", chipMore: "and {count} more",
    dropHere: "Drop programs here to make jobs of them.", dismiss: "Remove", sending: "being sent …",
    uploadInsecure: "A program of this size can be sent over https or from the service's own computer only; otherwise use feedwave submit.",
    uploadTooLarge: "More than {size} is for feedwave submit.",
  },
  de: {
    brand: "feedwave", skip: "Zum Inhalt", board: "Übersicht", jobs: "Aufträge", other: "English",
    themeAuto: "Farben: System", themeLight: "Farben: hell", themeDark: "Farben: dunkel",
    loading: "Wird geladen …", failed: "Konnte nicht gelesen werden: {reason}",
    missing: "Diese Seite gibt es nicht.",
    lost: "Seit {time} keine Verbindung zum Dienst. Die Anzeige ist nicht aktuell.",
    token: "Zugangstoken", tokenWhy: "Der Dienst will wissen, wer Sie sind.", tokenGo: "Weiter",
    noMachines: "Es gibt keine Maschinen.", noneMatches: "Keine Maschine ist in einem solchen Zustand.",
    all: "Alle", attention: "Auffällige", wall: "Wand", dense: "Dicht", page: "Seite {page} von {pages}",
    filter: "Anzeigen", view: "Ansicht",
    now: "jetzt", decidedAgo: "vor {age} entschieden",
    noData: "keine Daten", idle: "frei", ready: "bereit", running: "läuft", held: "Halt", stopped: "gestoppt",
    done: "fertig", fault: "Störung", interrupted: "getrennt",
    feed: "Vorschub", spindle: "Spindel", override: "Vorschub-Override", left: "Rest", line: "Zeile {line}", tool: "T{tool}",
    deviation: "Auslenkung", amplitude: "Schwingungsamplitude", frequency: "Schwingungsfrequenz",
    limits: "{lower} bis {upper} {unit}", further: "und {count} weitere", age: "Daten sind {age} alt",
    pathFeed: "Bahnvorschub", machine: "Maschine", job: "Auftrag", program: "Programm", run: "Lauf",
    state: "Zustand", created: "Angelegt", findings: "Befunde", errors: "Fehler: {count}", warnings: "Warnungen: {count}", notes: "Hinweise: {count}",
    none: "keine", progress: "Fortschritt", queued: "Platz {place} der Warteschlange", validated: "{percent} gelesen",
    more: "Mehr anzeigen", pending: "wartet", validating: "wird geprüft", jobReady: "bereit", rejected: "abgelehnt",
    cancelled: "abgebrochen", jobFailed: "gescheitert", unknown: "unbekannt", sinceTime: "seit {time}",
    dominant: "Stärkste Linie", decisions: "Entscheidungen", decisionsLast: "Die letzten {count} von {all} Entscheidungen", noDecisions: "Noch wurde nichts entschieden.",
    decision: "Entscheidung {number}", time: "Zeit", action: "Handlung", reason: "Grund", seen: "Gesehen", limit: "Grenze",
    before: "Vorher", after: "Nachher", trends: "Verläufe", window: "Fenster", samples: "{valid} von {all} Werten",
    condition: "Meldungen", acknowledged: "quittiert von {name}", toAcknowledge: "nicht quittiert",
    noConditions: "Nichts ist auffällig.", spindleSpeed: "Spindeldrehzahl", next: "Nächster Befund",
    previous: "Voriger Befund", cure: "Abhilfe", noFindings: "Die Prüfung hat nichts gefunden.",
    noReport: "Es gibt noch keinen Bericht.", source: "Quelltext", duration: "Bearbeitungszeit",
    path: "Weg", lines: "Zeilen", occurrences: "{count}-mal", inFile: "in {file}",
    tooLong: "Nur die ersten {size} des Programms werden gezeigt.",
    chart: "{name}: {from} bis {to}, zuletzt {last} {unit}", empty: "noch keine Werte", bounds: "an seiner Grenze",
    live: "Live-Lauf", telemetryRun: "Telemetrie",
    keyboard: "Tasten: n und p gehen zum nächsten und vorigen Befund.",
    noEvidence: "kein Beleg", heldByOperator: "vom Bediener angehalten", otherRuns: "+{count} Läufe",
    otherRun: "+1 Lauf", ofOtherRun: "anderer Lauf", overrideDecided: "Vorschub-Override, bis {time} entschieden, danach in Kraft",
    allDecided: "Vorschub-Override, entschieden",
    notShown: "Die Maschine zeigt einen anderen Lauf: was hier auffällig ist, wird nicht gemeldet.",
    tenant: "Mandant", tenantGo: "Anzeigen", leave: "{name} abmelden", check: "Prüfen", checkTitle: "Programm prüfen", runs: "Läufe", programLine: "Programmzeile", edit: "Kopie bearbeiten",
    choose: "Datei wählen", tools: "Werkzeuge", toolsAny: "Werkzeuge: alle", toolsSome: "Werkzeuge: {count}",
    createJob: "Auftrag anlegen", createJobs: "{count} Aufträge anlegen", checking: "wird geprüft …",
    foundCount: "Befunde: {count}", cuttingTime: "Schnittzeit", sections: "Schwingende Abschnitte",
    checkEmpty: "Ein Programm hierher ziehen, eine Datei wählen oder schreiben. Nichts wird gespeichert.",
    checkTooLarge: "{name} hat {size}; geprüft werden hier bis zu {limit}. Ein größeres Programm wird ein Auftrag.",
    checkForeign: "Die Datei ist nicht UTF-8; sie wurde als Windows-1252 gelesen.", checkFailed: "Das ging nicht: {reason}",
    checkViewer: "Nur Befunde des Interpreters: die Prüfung braucht die Rolle planner.",
    editorKeys: "Tasten: F8 und Umschalt F8 gehen zum nächsten und vorigen Befund, Alt Enter wendet seine Abhilfe an.",
    cureWith: "Ersetzen durch", curesBy: "Entfernen", drawing: "Bahn", viewSpace: "Raum", viewTop: "Oben",
    viewFront: "Vorn", viewSide: "Seite", drawnToError: "gezeichnet bis zum ersten Fehler", viewLathe: "Drehen", pathRapid: "Eilgang", pathCut: "Schnitt",
    pathVibrating: "Schnitt mit Schwingung", pathLong: "nur die ersten {moves} Bewegungen sind gezeichnet", radius: "X ist ein Radius",
    drawingKeys: "Ziehen dreht, Umschalt und Ziehen verschiebt, das Rad vergrößert. Tasten: Pfeile, Umschalt Pfeile, + und −, 0 für alles, 1 bis 4 für die Ansichten.",
    chips: "Späne", chipProgrammed: "Programmiert: {frequency} Hz, Amplitude {amplitude} mm",
    chipSuggested: "Zum Vergleich: {frequency} Hz, Amplitude {amplitude} mm", chipThickness: "Spandicke",
    chipTracks: "Bahnen aufeinander folgender Umdrehungen: wo sie sich kreuzen, bricht der Span",
    chipRevolutions: "Spandicke über Umdrehungen der Spindel; unter 0: Luft",
    chipAngle: "Werkzeuglage über dem Spindelwinkel, Grad, in 4 Umdrehungen nacheinander", chipPerRev: "{count} Schwingungen je Umdrehung",
    chipBreaks: "der Span bricht", chipInPhase: "in Phase, keine Amplitude bricht den Span",
    chipShort: "die Amplitude ist {percent} % derer, die den Span bricht",
    chipLines: "Zeilen {first} bis {last} · {spindle} /min · {feed} mm/U", chipMore: "und {count} weitere",
    dropHere: "Programme hierher ziehen, um Aufträge daraus zu machen.", dismiss: "Entfernen", sending: "wird gesendet …",
    uploadInsecure: "Ein Programm dieser Größe geht nur über https oder vom Rechner des Dienstes; sonst mit feedwave submit.",
    uploadTooLarge: "Mehr als {size} geht mit feedwave submit.",
  },
};

// Codes of conditions, actions and reasons in words. A code that is not here is shown as it is.
const CODES = {
  en: {
    KEEP: "keep", CHANGE: "change", HOLD: "hold", STOP: "stop", HOLD_FEED: "hold the feed",
    TOOL_FIT: "tool runs true", REPLACE_TOOL: "replace the tool", MACHINE_FIT: "machine runs quietly",
    SERVICE_MACHINE: "service the machine", WITHIN_LIMITS: "within limits", FEED_BELOW_LIMIT: "below the limit",
    FEED_ABOVE_LIMIT: "above the limit", ANGLE_BELOW_LIMIT: "angle below its limit", ANGLE_ABOVE_LIMIT: "angle above its limit",
    SPEED_FROM_TABLE: "speed from the table", SPEED_NOT_IN_TABLE: "speed is in no band of the table",
    SPEED_UNKNOWN: "spindle speed unknown", THREADING: "a thread is being cut", DATA: "bad data",
    SILENCE: "telemetry is silent", ABOVE_LIMIT_AT_BOUND: "above the limit at the lowest feed", FEED_HELD: "feed is held",
    TOO_FEW_SAMPLES: "too few samples", NOT_FINITE: "values are not finite", STUCK_SENSOR: "sensor is stuck",
    SENSOR_MISSING: "a sensor is missing", TIME_OUT_OF_ORDER: "times out of order", TIME_GAP: "gap in the times",
    TIME_TOO_DENSE: "times too dense", STALE: "data is stale", BATCH_GAP: "batches are missing",
    POINTS_MISSING: "angular points are missing", OTHER_TOOL: "baseline of another tool", NO_SPECTRUM: "no spectrum",
    FINDINGS: "program has warnings", RECEIPTS_MISSING: "no receipts of setpoints", MESSAGES_UNREAD: "messages were not read",
    STREAM_UNREAD: "stream was not read", REQUEST_STALLED: "request came to a halt", STORE_UNAVAILABLE: "store cannot be reached",
    STORE_DAMAGED: "store is damaged", INTERNAL: "error of the service", INVALID_FIELDS: "client sent what is not valid",
    ERROR: "error", WARNING: "warning", INFO: "note", FAULT: "fault",
  },
  de: {
    KEEP: "beibehalten", CHANGE: "ändern", HOLD: "nichts entscheiden", STOP: "stoppen", HOLD_FEED: "Vorschub anhalten",
    TOOL_FIT: "Werkzeug läuft rund", REPLACE_TOOL: "Werkzeug wechseln", MACHINE_FIT: "Maschine läuft ruhig",
    SERVICE_MACHINE: "Maschine warten", WITHIN_LIMITS: "innerhalb der Grenzen", FEED_BELOW_LIMIT: "unter der Grenze",
    FEED_ABOVE_LIMIT: "über der Grenze", ANGLE_BELOW_LIMIT: "Winkel unter der Grenze", ANGLE_ABOVE_LIMIT: "Winkel über der Grenze",
    SPEED_FROM_TABLE: "Drehzahl aus der Tabelle", SPEED_NOT_IN_TABLE: "Drehzahl in keinem Band der Tabelle",
    SPEED_UNKNOWN: "Drehzahl unbekannt", THREADING: "ein Gewinde wird geschnitten", DATA: "schlechte Daten",
    SILENCE: "Telemetrie schweigt", ABOVE_LIMIT_AT_BOUND: "über der Grenze bei kleinstem Vorschub",
    FEED_HELD: "Vorschub ist angehalten", TOO_FEW_SAMPLES: "zu wenige Werte", NOT_FINITE: "Werte sind nicht endlich",
    STUCK_SENSOR: "Sensor hängt", SENSOR_MISSING: "ein Sensor fehlt", TIME_OUT_OF_ORDER: "Zeiten nicht geordnet",
    TIME_GAP: "Lücke in den Zeiten", TIME_TOO_DENSE: "Zeiten zu dicht", STALE: "Daten sind veraltet",
    BATCH_GAP: "Pakete fehlen", POINTS_MISSING: "Winkelpunkte fehlen", OTHER_TOOL: "Grundlinie eines anderen Werkzeugs",
    NO_SPECTRUM: "kein Spektrum", FINDINGS: "Programm hat Warnungen", RECEIPTS_MISSING: "keine Quittungen über Sollwerte",
    MESSAGES_UNREAD: "Meldungen nicht gelesen", STREAM_UNREAD: "Strom nicht gelesen", REQUEST_STALLED: "Anfrage kam zum Stehen",
    STORE_UNAVAILABLE: "Speicher nicht erreichbar", STORE_DAMAGED: "Speicher beschädigt", INTERNAL: "Fehler des Dienstes",
    INVALID_FIELDS: "Client sandte Ungültiges", ERROR: "Fehler", WARNING: "Warnung", INFO: "Hinweis", FAULT: "Störung",
  },
};

const remembered = (key) => {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
};

const remember = (key, value) => {
  try {
    localStorage.setItem(key, value);
  } catch {
    // A browser that keeps nothing asks its own settings each time.
  }
};

let language = remembered("language") ?? (navigator.language.toLowerCase().startsWith("de") ? "de" : "en");
if (!(language in WORDS)) language = "en";

export const currentLanguage = () => language;

/** The language as the reader's browser writes it: times of day and signs of numbers are a country's. */
const locale = () => navigator.languages?.find((name) => name.toLowerCase().startsWith(language)) ?? language;

export const switchLanguage = () => {
  language = language === "en" ? "de" : "en";
  remember("language", language);
};

export { remember, remembered };

/** A word or sentence, with what is in braces filled in. */
export const t = (key, values = {}) =>
  (WORDS[language][key] ?? key).replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole));

/** A code in words. */
export const code = (name) => CODES[language][name] ?? name.toLowerCase().replaceAll("_", " ");

/** The name of an enum value without its prefix. */
export const short = (value, prefix) => (value ?? "").replace(prefix, "");

/** How severe a finding is and which it is, in the language of the page. */
export const findingName = (finding) => `${code(short(finding.severity, "SEVERITY_"))} ${finding.code}`;

const formats = new Map();
const format = (digits) => {
  const key = `${language}${digits}`;
  if (!formats.has(key)) {
    const options = { minimumFractionDigits: digits, maximumFractionDigits: digits, signDisplay: "negative" };
    formats.set(key, new Intl.NumberFormat(locale(), options));
  }
  return formats.get(key);
};

/** A number with so many digits behind the point; a dash where there is none. */
export const number = (value, digits = 0) =>
  value === undefined || value === null || !Number.isFinite(Number(value)) ? "–" : format(digits).format(Number(value));

/** A ratio in per cent. */
export const percent = (ratio, digits = 0) =>
  ratio === undefined || ratio === null ? "–" : `${number(ratio * 100, digits)} %`;

/** A value in millimetres, hertz or the like, with digits that fit its unit. */
export const measured = (value, unit) => number(value, unit === "mm" ? 4 : unit === "Hz" ? 1 : 0);

/** A length of time: 1:02:03, 4:05 or 7 s. */
export const duration = (seconds) => {
  if (seconds === undefined || seconds === null || !Number.isFinite(seconds)) return "–";
  const whole = Math.max(0, Math.round(seconds));
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (part) => String(part).padStart(2, "0");
  if (h > 0) return `${h}:${two(m)}:${two(s)}`;
  return m > 0 ? `${m}:${two(s)}` : `${s} s`;
};

/** A time of day; with its date where it is of another day. */
export const clock = (time) => {
  const date = new Date(time);
  const today = date.toDateString() === new Date().toDateString();
  return new Intl.DateTimeFormat(locale(), today ? { timeStyle: "medium" } : { dateStyle: "short", timeStyle: "medium" })
    .format(date);
};

/** So many bytes. */
export const bytes = (count) => {
  const units = ["B", "KiB", "MiB", "GiB"];
  const power = Math.min(units.length - 1, Math.floor(Math.log2(Math.max(1, count)) / 10));
  return `${number(count / 1024 ** power, power === 0 ? 0 : 1)} ${units[power]}`;
};
