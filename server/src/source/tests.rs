use super::*;

async fn sources(path: &std::path::Path) -> Result<Arc<Sources>, ServerError> {
    Sources::new(&[path.to_owned()], &Upstream::default(), &Arc::default())
        .await
        .map(Arc::new)
}

#[tokio::test]
async fn a_file_that_is_no_marq_is_refused_at_start_and_skipped_in_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.marq");
    std::fs::write(&path, b"not a marq file").unwrap();
    assert!(matches!(
        sources(&path).await,
        Err(ServerError::File { .. })
    ));
    let sources = sources(folder.path()).await.unwrap();
    assert!(sources.list().await.is_empty());
    for old in [false, true] {
        match sources.open("a").await {
            Err(LookUpError::Unusable { old: found, .. }) => assert_eq!(found, old),
            other => panic!("{other:?}"),
        }
    }
    assert!(matches!(sources.open("b").await, Err(LookUpError::Unknown)));
}

#[tokio::test]
async fn what_is_neither_file_nor_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.marq");
    assert!(matches!(
        sources(&missing).await,
        Err(ServerError::Path { .. })
    ));
    let other = folder.path().join("mesh.ply");
    std::fs::write(&other, b"ply").unwrap();
    assert!(matches!(
        sources(&other).await,
        Err(ServerError::Kind { .. })
    ));
    for url in ["s3://", "http:///x"] {
        assert!(matches!(
            sources(std::path::Path::new(url)).await,
            Err(ServerError::Url { .. })
        ));
    }
}
