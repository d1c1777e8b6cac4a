-- The service's memory. What products are is on the disk, in their manifests; this is what is known of them, and of work.
-- Times are milliseconds of UTC since 1970.

CREATE TABLE service (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  pid INTEGER NOT NULL, boot_id TEXT NOT NULL, address TEXT NOT NULL, version TEXT NOT NULL,
  started_ms INTEGER NOT NULL, beat_ms INTEGER NOT NULL
) STRICT;

-- Folders of inputs.
CREATE TABLE root (
  path TEXT PRIMARY KEY, kind TEXT NOT NULL CHECK (kind IN ('sites', 'kernels', 'data')),
  device INTEGER, files INTEGER NOT NULL, state TEXT NOT NULL CHECK (state IN ('available', 'settling', 'unavailable')),
  since_ms INTEGER NOT NULL, detail TEXT NOT NULL
) STRICT;

-- Files below them, as they were when they were last used.
CREATE TABLE file_version (
  path TEXT PRIMARY KEY,
  device INTEGER NOT NULL, inode INTEGER NOT NULL, size INTEGER NOT NULL, mtime_ns INTEGER NOT NULL, ctime_ns INTEGER NOT NULL,
  blake3 TEXT, first_seen_ms INTEGER NOT NULL, changed_ms INTEGER NOT NULL, checked_ms INTEGER,
  state TEXT NOT NULL CHECK (state IN ('settling', 'ready', 'bad', 'gone')), detail TEXT NOT NULL DEFAULT '',
  -- The round of comparisons that found the content it has: counted, since clocks jump.
  round INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX file_version_round ON file_version (round);
CREATE INDEX file_version_settling ON file_version (state) WHERE state = 'settling';

-- What a kernel covers, by its content; JSON as `areograph kernels coverage --json` gives it.
CREATE TABLE kernel_coverage (blake3 TEXT PRIMARY KEY, coverage TEXT NOT NULL) STRICT;

CREATE TABLE site (
  name TEXT PRIMARY KEY, file TEXT NOT NULL, config_blake3 TEXT NOT NULL, enabled INTEGER NOT NULL, problem TEXT,
  current_run TEXT, checked_ms INTEGER, current_since_ms INTEGER, stale_since_ms INTEGER, stale_because TEXT,
  last_note TEXT,
  -- The round in which all that it could read was last compared; 0: it is to be planned.
  round INTEGER NOT NULL DEFAULT 0,
  west_deg REAL, south_deg REAL, east_deg REAL, north_deg REAL,
  -- Of its windows, as its next plan states.
  body TEXT NOT NULL DEFAULT 'mars'
) STRICT;

-- Which files a site reads, from its plan and its last manifest.
CREATE TABLE site_input (
  site TEXT NOT NULL REFERENCES site (name) ON DELETE CASCADE, path TEXT NOT NULL, role TEXT NOT NULL, blake3 TEXT,
  PRIMARY KEY (site, path)
) STRICT, WITHOUT ROWID;
CREATE INDEX site_input_path ON site_input (path);

CREATE TABLE night (
  id INTEGER PRIMARY KEY, due_ms INTEGER NOT NULL UNIQUE, zone TEXT NOT NULL,
  started_ms INTEGER, ended_ms INTEGER,
  how TEXT NOT NULL CHECK (how IN ('due', 'caught_up', 'asked', 'missed')),
  sites_checked INTEGER NOT NULL DEFAULT 0, runs INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0
) STRICT;

CREATE TABLE job (
  id INTEGER PRIMARY KEY AUTOINCREMENT, site TEXT NOT NULL, state TEXT NOT NULL,
  priority INTEGER NOT NULL, attempt INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0,
  not_before_ms INTEGER NOT NULL DEFAULT 0, force INTEGER NOT NULL DEFAULT 0, cancel_asked INTEGER NOT NULL DEFAULT 0,
  night INTEGER REFERENCES night (id), asked_by TEXT,
  created_ms INTEGER NOT NULL, changed_ms INTEGER NOT NULL, ended_ms INTEGER, outcome TEXT
) STRICT;
CREATE UNIQUE INDEX job_active ON job (site) WHERE state IN ('starting', 'running', 'cancelling');
CREATE UNIQUE INDEX job_pending ON job (site) WHERE state IN ('held', 'queued', 'waiting', 'blocked');
CREATE INDEX job_state ON job (state, not_before_ms);
CREATE INDEX job_site ON job (site, id);
CREATE INDEX job_night ON job (night);

-- Why a job is there.
CREATE TABLE cause (
  job INTEGER NOT NULL REFERENCES job (id) ON DELETE CASCADE,
  kind TEXT NOT NULL CHECK (kind IN
    ('kernel_changed', 'data_changed', 'config_changed', 'tool_changed', 'first', 'scheduled', 'asked', 'retry_of', 'product_damaged')),
  path TEXT, old_blake3 TEXT, new_blake3 TEXT, detail TEXT NOT NULL, at_ms INTEGER NOT NULL
) STRICT;
CREATE INDEX cause_job ON cause (job);

CREATE TABLE attempt (
  job INTEGER NOT NULL REFERENCES job (id) ON DELETE CASCADE, n INTEGER NOT NULL,
  pid INTEGER, pid_start INTEGER, boot_id TEXT,
  -- Whether Slurm runs it; NULL for attempts of a layout before 4.
  on_cluster INTEGER,
  started_ms INTEGER NOT NULL, beat_ms INTEGER NOT NULL, rss_kib INTEGER, stage TEXT, done INTEGER, of INTEGER, unit TEXT,
  ended_ms INTEGER, how TEXT, exit INTEGER, signal INTEGER, log TEXT NOT NULL,
  PRIMARY KEY (job, n)
) STRICT;

CREATE TABLE run (
  id TEXT PRIMARY KEY, site TEXT NOT NULL, job INTEGER NOT NULL, attempt INTEGER NOT NULL,
  version TEXT NOT NULL, manifest_blake3 TEXT NOT NULL, valid INTEGER NOT NULL, verdict TEXT NOT NULL,
  reasons TEXT NOT NULL, because TEXT NOT NULL, stages TEXT NOT NULL,
  counts TEXT NOT NULL, figures TEXT NOT NULL, kernels TEXT NOT NULL,
  predecessor TEXT, moved TEXT, published_ms INTEGER NOT NULL, pinned INTEGER NOT NULL DEFAULT 0, removed_ms INTEGER,
  -- When its products were last read, and how many of them do not match its manifest.
  checked_ms INTEGER, damaged INTEGER NOT NULL DEFAULT 0,
  UNIQUE (job, attempt)
) STRICT;
CREATE INDEX run_site ON run (site, published_ms);

-- What happened, in order: feeds the stream of events. Old ones are removed.
CREATE TABLE event (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, at_ms INTEGER NOT NULL, kind TEXT NOT NULL,
  site TEXT, job INTEGER, run TEXT, data TEXT NOT NULL
) STRICT;

-- Alerts to be delivered to hooks, at least once.
CREATE TABLE outbox (
  id INTEGER PRIMARY KEY AUTOINCREMENT, hook INTEGER NOT NULL, kind TEXT NOT NULL, body TEXT NOT NULL,
  tries INTEGER NOT NULL DEFAULT 0, not_before_ms INTEGER NOT NULL, created_ms INTEGER NOT NULL, delivered_ms INTEGER, error TEXT
) STRICT;
CREATE INDEX outbox_open ON outbox (not_before_ms) WHERE delivered_ms IS NULL;

-- Edges that were told, so that a state is told once.
CREATE TABLE alert_state (subject TEXT PRIMARY KEY, state TEXT NOT NULL, since_ms INTEGER NOT NULL) STRICT;

CREATE TABLE audit (
  id INTEGER PRIMARY KEY AUTOINCREMENT, at_ms INTEGER NOT NULL, who TEXT NOT NULL, action TEXT NOT NULL,
  target TEXT NOT NULL, remote TEXT NOT NULL
) STRICT;

CREATE TABLE token (
  id TEXT PRIMARY KEY, sha256 BLOB NOT NULL, role TEXT NOT NULL CHECK (role IN ('read', 'operate')), note TEXT NOT NULL,
  created_ms INTEGER NOT NULL, expires_ms INTEGER, revoked_ms INTEGER, used_ms INTEGER
) STRICT;

CREATE TABLE session (
  sha256 BLOB PRIMARY KEY, token TEXT NOT NULL REFERENCES token (id) ON DELETE CASCADE, csrf TEXT NOT NULL,
  created_ms INTEGER NOT NULL, seen_ms INTEGER NOT NULL
) STRICT;

-- A request that was answered once is answered the same again for a day.
CREATE TABLE idempotency (
  key TEXT PRIMARY KEY, token TEXT NOT NULL, request_blake3 TEXT NOT NULL, jobs TEXT NOT NULL, at_ms INTEGER NOT NULL
) STRICT;

-- Small facts by name.
CREATE TABLE fact (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
