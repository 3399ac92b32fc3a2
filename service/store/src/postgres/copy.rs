//! What a store in an SQLite file holds, into an empty database: table by table, in one transaction, each compared by its
//! hash with what was read.

mod objects;
mod tables;

use futures_util::TryStreamExt as _;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{
    AssertSqlSafe, ConnectOptions as _, Connection as _, PgConnection, Postgres, QueryBuilder, Row as _,
    SqliteConnection,
};

use super::PostgresOptions;
use super::open::{connect, migrate};
use crate::error::{Result, StoreError};
use crate::maintenance::{CopyError, TableCopy};
use crate::settings::StoreSettings;
use crate::sql::record::Record;
use crate::sql::seal::Kind::Text;
use crate::sql::seal::Value;
use crate::sqlite::{SqliteOptions, SqliteStore, maintenance};
use tables::{OTHERS, TABLES, Table};

/// Rows and bytes of one statement.
const ROWS: usize = 500;
const BYTES: usize = 4 << 20;

/// A value of a column that a row no longer holds.
#[derive(Debug, Clone, PartialEq)]
enum Owned {
    Integer(Option<i64>),
    Real(f64),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

impl Owned {
    fn bytes(&self) -> usize {
        match self {
            Self::Integer(_) | Self::Real(_) => 8,
            Self::Text(text) => text.as_ref().map_or(0, String::len),
            Self::Bytes(bytes) => bytes.as_ref().map_or(0, Vec::len),
        }
    }
}

impl From<Value<'_>> for Owned {
    fn from(value: Value<'_>) -> Self {
        match value {
            Value::Integer(value) => Self::Integer(value),
            Value::Real(value) => Self::Real(value),
            Value::Text(value) => Self::Text(value.map(str::to_owned)),
            Value::Bytes(value) => Self::Bytes(value.map(<[u8]>::to_vec)),
        }
    }
}

impl Table {
    fn row<'a>(&self, row: &'a impl Record) -> Result<Vec<Value<'a>>> {
        self.columns.iter().map(|(column, kind)| Value::of(row, column, *kind)).collect()
    }

    fn names(&self) -> String {
        self.columns.iter().map(|(column, _)| *column).collect::<Vec<_>>().join(", ")
    }

    /// Everything in the order of the key, by the bytes of texts, which `collation` says.
    fn select(&self, collation: &str) -> String {
        let order = self.columns[..self.keys].iter().map(|(column, kind)| match kind {
            Text => format!("{column} {collation}"),
            _ => (*column).to_owned(),
        });
        format!("SELECT {} FROM {} ORDER BY {}", self.names(), self.name, order.collect::<Vec<_>>().join(", "))
    }

    async fn insert(&self, to: &mut PgConnection, rows: Vec<Vec<Owned>>) -> Result<()> {
        let mut sql = QueryBuilder::<Postgres>::new(format!("INSERT INTO {} ({}) ", self.name, self.names()));
        sql.push_values(rows, |mut row, values| {
            for value in values {
                match value {
                    Owned::Integer(value) => row.push_bind(value),
                    Owned::Real(value) => row.push_bind(value),
                    Owned::Text(value) => row.push_bind(value),
                    Owned::Bytes(value) => row.push_bind(value),
                };
            }
        });
        sql.build().persistent(false).execute(to).await?;
        Ok(())
    }

    /// Copies every row; how many, and their hash.
    async fn copy(&self, from: &mut SqliteConnection, to: &mut PgConnection) -> Result<(u64, [u8; 32]), CopyError> {
        let mut hash = Sha256::new();
        let (mut count, mut bytes, mut rows) = (0, 0, Vec::new());
        let sql = self.select("COLLATE BINARY");
        let mut read = sqlx::query(AssertSqlSafe(sql)).fetch(from);
        while let Some(row) = read.try_next().await.map_err(|error| CopyError::From(error.into()))? {
            let row = self.row(&row).map_err(CopyError::From)?;
            row.iter().for_each(|value| value.hash(&mut hash));
            let row: Vec<_> = row.into_iter().map(Owned::from).collect();
            bytes += row.iter().map(Owned::bytes).sum::<usize>();
            count += 1;
            rows.push(row);
            if rows.len() == ROWS || bytes >= BYTES {
                self.insert(to, std::mem::take(&mut rows)).await.map_err(CopyError::To)?;
                bytes = 0;
            }
        }
        if !rows.is_empty() {
            self.insert(to, rows).await.map_err(CopyError::To)?;
        }
        Ok((count, hash.finalize().into()))
    }

    /// The hash of every row that is there.
    async fn hash(&self, to: &mut PgConnection) -> Result<[u8; 32]> {
        let mut hash = Sha256::new();
        let sql = self.select("COLLATE \"C\"");
        let mut read = sqlx::query(AssertSqlSafe(sql)).fetch(to);
        while let Some(row) = read.try_next().await? {
            self.row(&row)?.iter().for_each(|value| value.hash(&mut hash));
        }
        Ok(hash.finalize().into())
    }
}

/// See [`crate::copy`].
pub(crate) async fn copy(from: &SqliteOptions, to: &PostgresOptions) -> Result<Vec<TableCopy>, CopyError> {
    if !from.path.is_file() {
        return Err(CopyError::From(StoreError::CannotOpen { reason: "there is no such file", source: None }));
    }
    // Up to date, and nobody else's until the end.
    let store = SqliteStore::open(from.clone(), StoreSettings::default()).await.map_err(CopyError::From)?;
    let copied = copy_held(from, to).await;
    crate::Database::close(&store).await;
    copied
}

async fn copy_held(from: &SqliteOptions, to: &PostgresOptions) -> Result<Vec<TableCopy>, CopyError> {
    let mut source = open_intact(from).await.map_err(CopyError::From)?;
    let to_fault = |error: sqlx::Error| CopyError::To(error.into());
    migrate(to).await.map_err(CopyError::To)?;
    let mut target = connect(to, &to.database).await.map_err(CopyError::To)?;
    let mut transaction = target.begin().await.map_err(to_fault)?;
    // A service that runs on it waits, and finds what was copied.
    let locked = sqlx::query("SELECT 1 FROM counters FOR UPDATE").execute(&mut *transaction).await;
    locked.map_err(to_fault)?;
    check_empty(&mut transaction).await.map_err(CopyError::To)?;
    let mut copies = Vec::new();
    for table in &TABLES {
        let (rows, hash) = table.copy(&mut source, &mut transaction).await?;
        if table.hash(&mut transaction).await.map_err(CopyError::To)? != hash {
            let reason = format!("what was written of {} is not what was read", table.name);
            return Err(CopyError::To(StoreError::corrupt(reason)));
        }
        copies.push(TableCopy { table: table.name, rows, sha256: hash });
    }
    copies.push(objects::copy(&mut source, &mut transaction).await?);
    let newest = newest_numbers(&mut source).await.map_err(CopyError::From)?;
    set_numbers(&mut transaction, newest).await.map_err(CopyError::To)?;
    transaction.commit().await.map_err(to_fault)?;
    source.close().await.map_err(|error| CopyError::From(error.into()))?;
    target.close().await.map_err(to_fault)?;
    Ok(copies)
}

/// A file of which everything is there and would be copied.
async fn open_intact(from: &SqliteOptions) -> Result<SqliteConnection> {
    let found = maintenance::check(&from.path, |_| Ok(())).await?;
    if let Some(first) = found.problems.first() {
        let count = found.problems.len() as u64 + found.further_problems;
        return Err(StoreError::Damaged { count, first: format!("{} {}: {}", first.kind, first.id, first.reason) });
    }
    let options = SqliteConnectOptions::new().filename(&from.path).create_if_missing(false).disable_statement_logging();
    let mut source = options.connect().await?;
    check_tables(&mut source).await?;
    Ok(source)
}

/// Refuses a file with a table or column that would be left out.
async fn check_tables(source: &mut SqliteConnection) -> Result<()> {
    let names: Vec<String> =
        sqlx::query_scalar("SELECT name FROM sqlite_schema WHERE type = 'table'").fetch_all(&mut *source).await?;
    for name in names.into_iter().filter(|name| !OTHERS.contains(&name.as_str())) {
        let Some(table) = TABLES.iter().find(|table| table.name == name) else {
            return Err(StoreError::Incompatible(format!("its table {name} would not be copied")));
        };
        let columns: Vec<String> =
            sqlx::query_scalar("SELECT name FROM pragma_table_info(?)").bind(&name).fetch_all(&mut *source).await?;
        if let Some(column) = columns.iter().find(|column| table.columns.iter().all(|(known, _)| known != column)) {
            return Err(StoreError::Incompatible(format!("its column {name}.{column} would not be copied")));
        }
    }
    Ok(())
}

/// Refuses a database in which there is anything already.
async fn check_empty(target: &mut PgConnection) -> Result<()> {
    for table in &TABLES {
        let sql = format!("SELECT EXISTS (SELECT 1 FROM {})", table.name);
        if sqlx::query_scalar(AssertSqlSafe(sql)).fetch_one(&mut *target).await? {
            return Err(StoreError::CannotOpen {
                reason: "there are records in the database to copy to",
                source: None,
            });
        }
    }
    Ok(())
}

/// The newest numbers of the logs in a file.
async fn newest_numbers(source: &mut SqliteConnection) -> Result<Vec<(String, i64)>> {
    let mut numbers = Vec::new();
    for (name, table) in [("event", "job_events"), ("decision", "decisions"), ("audit", "audit_entries")] {
        let row = sqlx::query("SELECT COALESCE(MAX(seq), 0) AS newest FROM sqlite_sequence WHERE name = ?")
            .bind(table)
            .fetch_one(&mut *source)
            .await?;
        numbers.push((name.to_owned(), row.try_get("newest")?));
    }
    // What is counted beside the rows of a table.
    for row in sqlx::query("SELECT name, newest FROM counters").fetch_all(&mut *source).await? {
        numbers.push((row.try_get("name")?, row.try_get("newest")?));
    }
    Ok(numbers)
}

/// Lets numbers go on where they were.
async fn set_numbers(target: &mut PgConnection, newest: Vec<(String, i64)>) -> Result<()> {
    for (name, newest) in newest {
        sqlx::query("UPDATE counters SET newest = $1 WHERE name = $2")
            .bind(newest)
            .bind(name)
            .execute(&mut *target)
            .await?;
    }
    for (table, column) in [("contents", "id"), ("programs", "sequence"), ("runs", "sequence")] {
        let sql = format!(
            "SELECT setval(pg_get_serial_sequence('{table}', '{column}'), (SELECT COALESCE(MAX({column}), 0) + 1 FROM {table}), \
             FALSE)"
        );
        sqlx::query(AssertSqlSafe(sql)).execute(&mut *target).await?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{OTHERS, TABLES, check_tables};
    use crate::settings::StoreSettings;
    use crate::sqlite::{SqliteOptions, SqliteStore};
    use sqlx::ConnectOptions as _;

    #[tokio::test]
    async fn every_table_and_column_of_a_file_is_copied() {
        let folder = tempfile::TempDir::new().unwrap();
        let options = SqliteOptions::new(folder.path().join("feedwave.db"));
        let _store = SqliteStore::open(options.clone(), StoreSettings::default()).await.unwrap();
        let connect = sqlx::sqlite::SqliteConnectOptions::new().filename(&options.path);
        let mut source = connect.connect().await.unwrap();
        check_tables(&mut source).await.unwrap();
        let there: BTreeSet<String> = sqlx::query_scalar("SELECT name FROM sqlite_schema WHERE type = 'table'")
            .fetch_all(&mut source)
            .await
            .unwrap()
            .into_iter()
            .collect();
        let known: BTreeSet<String> = TABLES.iter().map(|table| table.name).chain(OTHERS).map(str::to_owned).collect();
        assert_eq!(there, known);
        sqlx::query("CREATE TABLE later (id INTEGER)").execute(&mut source).await.unwrap();
        let refused = check_tables(&mut source).await.unwrap_err().to_string();
        assert!(refused.contains("its table later would not be copied"), "{refused}");
    }
}
