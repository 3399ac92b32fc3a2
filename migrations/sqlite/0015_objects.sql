-- Large programs that are kept in an object store.
CREATE TABLE objects (
    key        TEXT    NOT NULL PRIMARY KEY,
    -- URI of the object store, with what stands before the key there.
    place      TEXT    NOT NULL,
    size_bytes INTEGER NOT NULL,
    -- Since before it is written, so that none is there that is not known here.
    created_us INTEGER NOT NULL,
    -- What it holds; null until it is whole, and once nothing refers to it.
    content_id INTEGER UNIQUE REFERENCES contents (id) ON DELETE SET NULL,
    -- 1 once it is being removed: it is never taken into use again.
    leaving    INTEGER NOT NULL DEFAULT 0
) STRICT;

CREATE INDEX objects_unused ON objects (created_us) WHERE content_id IS NULL;

-- Where the chunks of a content are in its object: one behind the other, compressed as in program_chunks.
CREATE TABLE object_chunks (
    content_id    INTEGER NOT NULL REFERENCES contents (id) ON DELETE CASCADE,
    chunk_index   INTEGER NOT NULL,
    source_bytes  INTEGER NOT NULL,
    object_offset INTEGER NOT NULL,
    object_bytes  INTEGER NOT NULL,
    -- Of these bytes of the object.
    sha256        BLOB    NOT NULL,
    PRIMARY KEY (content_id, chunk_index)
) STRICT;
