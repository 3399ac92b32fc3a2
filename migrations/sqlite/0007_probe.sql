-- What is written to see whether writing works; the ballast stands for what a real write takes, once one has failed.
CREATE TABLE probe (
    id      INTEGER PRIMARY KEY CHECK (id = 1),
    at_us   INTEGER NOT NULL,
    ballast BLOB    NOT NULL
) STRICT;
