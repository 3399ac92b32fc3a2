//! Machine profiles and tools in PostgreSQL: two collections of one kind of document.

use async_trait::async_trait;
use sqlx::PgConnection;
use uuid::Uuid;

use super::PostgresStore;
use crate::Json;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::machines::{MachineRecord, Machines};
use crate::page::{Page, PageRequest};
use crate::sql::documents::{Document, MAX_ID_BYTES, after, check_body, check_etag, collection, scope, seal};
use crate::sql::pages::{id_token, page_of};
use crate::tools::{ToolFilter, ToolRecord, Tools};

/// A document that stays as it is until the transaction ends, if it is the one the caller read.
async fn hold(connection: &mut PgConnection, kind: Kind, id: &str, etag: Option<&str>) -> Result<()> {
    let row = sqlx::query("SELECT created_us, revision FROM documents WHERE collection = $1 AND id = $2 FOR UPDATE")
        .bind(collection(kind))
        .bind(id)
        .fetch_optional(connection)
        .await?;
    check_etag(&row.ok_or_else(|| StoreError::not_found(kind, id))?, kind, id, etag)
}

impl PostgresStore {
    async fn create(&self, kind: Kind, id: Option<&str>, number: Option<u32>, body: Json) -> Result<Document> {
        check_body(kind, &body, self.settings())?;
        let id = id.map_or_else(|| Uuid::now_v7().to_string(), str::to_owned);
        check_size("identifier size in bytes", id.len(), MAX_ID_BYTES)?;
        let now_us = self.clock().now_us();
        self.write(body.get().len(), move |connection| {
            let (id, body) = (id.clone(), body.clone());
            Box::pin(async move {
                let row = sqlx::query(
                    "INSERT INTO documents (collection, id, number, created_us, updated_us, revision, body, seal)
                     VALUES ($1, $2, $3, $4, $4, 1, $5, $6) ON CONFLICT DO NOTHING RETURNING *",
                )
                .bind(collection(kind))
                .bind(&id)
                .bind(number.map(i64::from))
                .bind(now_us)
                .bind(body.get())
                .bind(seal(kind, &id, number, &body))
                .fetch_optional(connection)
                .await?;
                Document::of(&row.ok_or(StoreError::AlreadyExists { kind, id })?)
            })
        })
        .await
    }

    async fn get(&self, kind: Kind, id: &str) -> Result<Document> {
        let row = sqlx::query("SELECT * FROM documents WHERE collection = $1 AND id = $2")
            .bind(collection(kind))
            .bind(id)
            .fetch_optional(&mut self.reader().await?)
            .await?;
        Document::of(&row.ok_or_else(|| StoreError::not_found(kind, id))?)
    }

    async fn list<T, F>(&self, kind: Kind, number: Option<u32>, page: &PageRequest, record: F) -> Result<Page<T>>
    where
        F: Fn(Document) -> Result<T>,
    {
        let scope = scope(kind, number);
        let after = after(&scope, &page.token)?;
        let size = page.bounded_size();
        let mut reader = self.reader().await?;
        let rows = sqlx::query(
            "SELECT * FROM documents WHERE collection = $1 AND id > $2 AND ($4::BIGINT IS NULL OR number = $4)
             ORDER BY id LIMIT $3",
        )
        .bind(collection(kind))
        .bind(after)
        .bind(size as i64 + 1)
        .bind(number.map(i64::from))
        .fetch(&mut reader);
        let page = page_of(rows, size, Document::of, Document::bytes, id_token(&scope)).await?;
        let items = page.items.into_iter().map(record).collect::<Result<Vec<_>>>()?;
        Ok(Page { items, next_token: page.next_token, unreachable: page.unreachable })
    }

    async fn update(
        &self,
        kind: Kind,
        id: &str,
        etag: Option<&str>,
        number: Option<u32>,
        body: Json,
    ) -> Result<Document> {
        check_body(kind, &body, self.settings())?;
        let (id, etag) = (id.to_owned(), etag.map(str::to_owned));
        let now_us = self.clock().now_us();
        self.write(body.get().len(), move |connection| {
            let (id, etag, body) = (id.clone(), etag.clone(), body.clone());
            Box::pin(async move {
                hold(connection, kind, &id, etag.as_deref()).await?;
                let row = sqlx::query(
                    "UPDATE documents SET number = $1, body = $2, updated_us = $3, revision = revision + 1, seal = $6
                     WHERE collection = $4 AND id = $5 RETURNING *",
                )
                .bind(number.map(i64::from))
                .bind(body.get())
                .bind(now_us)
                .bind(collection(kind))
                .bind(&id)
                .bind(seal(kind, &id, number, &body))
                .fetch_one(connection)
                .await?;
                Document::of(&row)
            })
        })
        .await
    }

    async fn delete(&self, kind: Kind, id: &str, etag: Option<&str>) -> Result<()> {
        let (id, etag) = (id.to_owned(), etag.map(str::to_owned));
        self.write(0, move |connection| {
            let (id, etag) = (id.clone(), etag.clone());
            Box::pin(async move {
                hold(connection, kind, &id, etag.as_deref()).await?;
                sqlx::query("DELETE FROM documents WHERE collection = $1 AND id = $2")
                    .bind(collection(kind))
                    .bind(&id)
                    .execute(connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}
#[async_trait]
impl Machines for PostgresStore {
    async fn create_machine(&self, id: Option<&str>, body: Json) -> Result<MachineRecord> {
        Ok(self.create(Kind::Machine, id, None, body).await?.into())
    }

    async fn machine(&self, id: &str) -> Result<MachineRecord> {
        Ok(self.get(Kind::Machine, id).await?.into())
    }

    async fn list_machines(&self, page: &PageRequest) -> Result<Page<MachineRecord>> {
        self.list(Kind::Machine, None, page, |document| Ok(document.into())).await
    }

    async fn update_machine(&self, id: &str, etag: Option<&str>, body: Json) -> Result<MachineRecord> {
        Ok(self.update(Kind::Machine, id, etag, None, body).await?.into())
    }

    async fn delete_machine(&self, id: &str, etag: Option<&str>) -> Result<()> {
        self.delete(Kind::Machine, id, etag).await
    }
}

#[async_trait]
impl Tools for PostgresStore {
    async fn create_tool(&self, id: Option<&str>, number: u32, body: Json) -> Result<ToolRecord> {
        self.create(Kind::Tool, id, Some(number), body).await?.try_into()
    }

    async fn tool(&self, id: &str) -> Result<ToolRecord> {
        self.get(Kind::Tool, id).await?.try_into()
    }

    async fn list_tools(&self, filter: &ToolFilter, page: &PageRequest) -> Result<Page<ToolRecord>> {
        self.list(Kind::Tool, filter.number, page, TryInto::try_into).await
    }

    async fn update_tool(&self, id: &str, etag: Option<&str>, number: u32, body: Json) -> Result<ToolRecord> {
        self.update(Kind::Tool, id, etag, Some(number), body).await?.try_into()
    }

    async fn delete_tool(&self, id: &str, etag: Option<&str>) -> Result<()> {
        self.delete(Kind::Tool, id, etag).await
    }
}
